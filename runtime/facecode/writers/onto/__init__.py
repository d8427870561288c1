"""Speech on somebody's own avatar: a glTF, .glb or VRM comes back with an animation added."""

from facecode.writers.onto.report import MeshReport, OntoReport
from facecode.writers.onto.splice import Weighted, check_avatar, onto

__all__ = ["MeshReport", "OntoReport", "Weighted", "check_avatar", "onto"]
