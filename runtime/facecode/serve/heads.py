"""The heads that the page draws: a .glb for each identity, whose shapes the weights move."""

from __future__ import annotations

import dataclasses
import io

from facecode.animation import Animation
from facecode.animator import Animator
from facecode.errors import NoFacesError
from facecode.template import TemplateSource
from facecode.writers.glb import write_glb


class Heads:
    """Made when they are first asked for, and kept: a bundle has few."""

    def __init__(self, face: Animator, template: TemplateSource | None = None) -> None:
        """Show `template` where no identity is asked for.

        Raises:
            TemplateError
        """
        self._still = dataclasses.replace(
            Animation.still(face.bundle), template=face.bundle.neutral(template)
        )
        self._bundle = face.bundle
        self._made: dict[str | None, bytes] = {}

    @property
    def identities(self) -> tuple[str, ...]:
        """Names of the bundle's identities."""
        return tuple(self._bundle.manifest.identities)

    def get(self, identity: str | None) -> bytes | None:
        """The .glb; None: no such identity, or a bundle without triangles."""
        if identity is not None and identity not in self.identities:
            return None
        if identity not in self._made:
            still = self._still
            if identity is not None:
                still = dataclasses.replace(still, template=self._bundle.identity(identity))
            file = io.BytesIO()
            try:
                write_glb(still, file)
            except NoFacesError:
                return None
            self._made[identity] = file.getvalue()
        return self._made[identity]
