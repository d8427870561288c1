"""Speech in, 3D facial animation out: run facecode bundles without torch.

face = facecode.load("bundle")
face.animate("speech.wav").save("talk.npz")
"""

from facecode.animation import Animation
from facecode.animator import Animator, load
from facecode.bundle import Bundle
from facecode.errors import FacecodeError
from facecode.many import animate_many
from facecode.takes import Takes

__version__ = "0.1.0"

__all__ = [
    "Animation",
    "Animator",
    "Bundle",
    "FacecodeError",
    "Takes",
    "__version__",
    "animate_many",
    "load",
]
