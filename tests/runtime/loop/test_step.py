"""The end of the loop."""


def test_the_last_frame_of_the_loop_has_no_codes_and_makes_the_rest_final(tiny, speech):
    engine = tiny.engine
    memory = engine.encode(speech[0][:16000])
    request = engine.request(window=tiny.window("window", 5))
    frames = list(engine.frames([memory], request))
    assert len(frames) == memory.n_frames + 1
    assert [bool(frame.codes) for frame in frames] == [True] * memory.n_frames + [False]
    n_final = sum(hidden.shape[1] for frame in frames for _, hidden in frame.final[0])
    assert n_final == memory.n_frames
    exact = list(engine.frames([memory], engine.request()))
    assert not any(final for frame in exact for final in frame.final)
