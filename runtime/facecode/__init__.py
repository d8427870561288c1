"""Speech in, 3D facial animation out: run facecode bundles without torch.

face = facecode.load("bundle")
face.animate("speech.wav").save("talk.npz")
"""

from facecode.animation import Animation
from facecode.animator import Animator
from facecode.audio import AudioSource
from facecode.blocks import Blocks
from facecode.bundle import Bundle
from facecode.clip import Clip, Rig
from facecode.clip_file import read_clip
from facecode.corpus.run import batch
from facecode.errors import FacecodeError
from facecode.loading import load
from facecode.many import animate_many
from facecode.options import Mode, Samples, Style
from facecode.session import Compute
from facecode.takes import Takes
from facecode.template import TemplateSource

__version__ = "0.1.0"

__all__ = [
    "Animation",
    "Animator",
    "AudioSource",
    "Blocks",
    "Bundle",
    "Clip",
    "Compute",
    "FacecodeError",
    "Mode",
    "Rig",
    "Samples",
    "Style",
    "Takes",
    "TemplateSource",
    "__version__",
    "animate_many",
    "batch",
    "load",
    "read_clip",
]
