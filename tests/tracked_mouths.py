"""A folder of tracked people whom nobody filmed, for the readers of captured speech."""

import json

import numpy as np
import soundfile

# lips, outer edges, chin, below the nose, corners of the mouth, corners of the eyes: x, y down
FACE = np.array(
    [
        *([0, 40], [0, 40], [0, 33], [0, 52], [0, 85], [0, 25]),
        *([-25, 40], [25, 40], [-45, -30], [45, -30]),
    ],
    float,
)
NUMBERS = [13, 14, 0, 17, 152, 2, 61, 291, 33, 263]
N_FRAMES, FPS = 20, 25.0
SAID = [["SIL", 0.0, 0.2, "-"], ["AA", 0.2, 0.4, "a"], ["P", 0.4, 0.5, "pa"], ["AA", 0.5, 0.7, "a"]]


def opened(mm):
    """(T, 10, 2) at 1 pixel a mm: the lower lip, its edge and the chin go down by so much."""
    face = np.repeat(FACE[None], len(mm), axis=0)
    face[:, [1, 3, 4], 1] += np.asarray(mm)[:, None]
    return face


def write_mouth_tracks(folder, n_clips, speech, rate):
    """Clips of 0.8 s of one speaker whose mouth opens to 12 mm; `speech` (n,) is cut into them."""
    gap = np.r_[np.zeros(5), np.linspace(0, 12, 15)]
    points = np.zeros((n_clips * N_FRAMES, len(NUMBERS), 3))
    points[..., :2] = opened(np.tile(gap, n_clips)) + 150
    scores = np.zeros((len(points), 2), np.float16)
    scores[:, 0] = 0.1 + 0.5 * (np.tile(gap, n_clips) > 6)
    names = [f"c{i:02d}" for i in range(n_clips)]
    np.savez(
        folder / "made_tracks.npz",
        landmarks_px32=np.round(32 * points).astype(np.int16),
        landmark_index=np.array(NUMBERS),
        blendshapes=scores,
        blendshape_names=np.array(["mouthPucker", "mouthFunnel"]),
        start=N_FRAMES * np.arange(n_clips),
        length=np.full(n_clips, N_FRAMES),
        clip=np.array(names),
        speaker=np.array(["s1"] * n_clips),
        fps=np.array(FPS),
    )
    (folder / "phones.json").write_text(json.dumps({f"s1_{name}": SAID for name in names}))
    n_samples = round(N_FRAMES / FPS * rate)
    for i, name in enumerate(names):
        soundfile.write(folder / f"s1_{name}.wav", np.roll(speech, -i * rate)[:n_samples], rate)
