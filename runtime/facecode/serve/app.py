"""The server as an ASGI application: the socket, the page, its head, health and counts."""

from __future__ import annotations

import asyncio
import logging

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from facecode.errors import FacecodeError
from facecode.live.plan import LOOK_AHEAD_MS
from facecode.serve.access import Access
from facecode.serve.errors import ProtocolError
from facecode.serve.files import FILES, HEADERS
from facecode.serve.heads import Heads
from facecode.serve.house import House
from facecode.serve.limits import OPENING_S
from facecode.serve.protocol import PROTOCOL, Opening, message, parse_opening
from facecode.serve.session import CODES, End, Session, gone, sent

logger = logging.getLogger("facecode.serve")


def build_app(house: House, heads: Heads, access: Access) -> Starlette:
    """The application."""
    doors = _Doors(house, heads, access)
    routes = [
        WebSocketRoute("/stream", doors.stream),
        Route("/healthz", doors.healthz),
        Route("/metrics", doors.metrics),
        Route("/face.json", doors.face),
        Route("/head.glb", doors.head),
        Route("/{name:path}", doors.file),
    ]
    hosts = Middleware(
        TrustedHostMiddleware, allowed_hosts=access.trusted_hosts, www_redirect=False
    )
    return Starlette(routes=routes, middleware=[hosts])


class _Doors:
    """What answers the requests."""

    def __init__(self, house: House, heads: Heads, access: Access) -> None:
        self._house, self._heads, self._access = house, heads, access

    async def healthz(self, _: Request) -> Response:
        """Whether the server answers and a worker works."""
        await self._house.work(lambda: None)
        return PlainTextResponse("ok\n")

    async def metrics(self, request: Request) -> Response:
        if not self._access.allows_header(request.headers.get("authorization")):
            return PlainTextResponse("a token is needed\n", 401)
        text = self._house.metrics.text()
        return PlainTextResponse(text, media_type="text/plain; version=0.0.4")

    async def file(self, request: Request) -> Response:
        path = FILES.get(request.path_params["name"])
        if path is None:
            return PlainTextResponse("no such page\n", 404)
        return FileResponse(path, headers=HEADERS)

    async def face(self, request: Request) -> Response:
        """What the page offers to choose from."""
        if not self._access.allows_header(request.headers.get("authorization")):
            return PlainTextResponse("a token is needed\n", 401, headers=HEADERS)
        m = self._house.face.manifest
        known = {
            "fps": m.fps,
            "styles": m.styles,
            "identities": self._heads.identities,
            "look_ahead_ms": LOOK_AHEAD_MS,
        }
        return JSONResponse(known, headers=HEADERS)

    async def head(self, request: Request) -> Response:
        if not self._access.allows_header(request.headers.get("authorization")):
            return PlainTextResponse("a token is needed\n", 401, headers=HEADERS)
        identity = request.query_params.get("identity")
        glb = await self._house.work(lambda: self._heads.get(identity))
        if glb is None:
            return PlainTextResponse("no such head\n", 404, headers=HEADERS)
        return Response(glb, media_type="model/gltf-binary", headers=HEADERS)

    async def stream(self, socket: WebSocket) -> None:
        """Serve a client from its first message to its end, and count how it ended."""
        try:
            end = await self._serve(socket)
        except Exception:
            logger.exception("a session failed")
            end = End("defect", "the server failed; its log says why")
        self._house.metrics.ended[end.reason] += 1
        if end.reason not in CODES:
            return
        if end.reason != "finished":
            await sent(socket.send_text(message("end", reason=end.reason, message=end.text)))
        await sent(socket.close(CODES[end.reason], end.reason))

    async def _serve(self, socket: WebSocket) -> End:
        headers = socket.headers
        if not self._access.allows_origin(headers.get("origin"), headers.get("host")):
            refusal = PlainTextResponse("pages of this origin may not use this server\n", 403)
            await socket.send_denial_response(refusal)
            return End("origin")
        with self._house.threshold() as room:
            await socket.accept()
            if not room:
                return End("busy", "too many clients have not said what they want; come later")
            opening = await self._opening(socket)
        if isinstance(opening, End):
            return opening
        with self._house.place() as free:
            if not free:
                n = self._house.limits.sessions
                return End("busy", f"all {n} places are taken; come later")
            return await self._session(socket, opening)

    async def _opening(self, socket: WebSocket) -> Opening | End:
        try:
            got = await asyncio.wait_for(socket.receive(), OPENING_S)
            if got["type"] == "websocket.disconnect":
                return gone(got)
            opening = parse_opening(got.get("text"))
        except asyncio.TimeoutError:
            return End("idle", f"no opening message within {OPENING_S:g} s")
        except ProtocolError as error:
            return End("rubbish", str(error))
        if not self._access.allows(opening.token):
            return End("token", 'expected "token", the one that this server was started with')
        return opening

    async def _session(self, socket: WebSocket, opening: Opening) -> End:
        try:
            stream = await self._house.stream(opening)
        except FacecodeError as error:
            return End("rubbish", str(error))
        ready = message(
            "ready",
            protocol=PROTOCOL,
            fps=stream.plan.fps,
            latency_ms=stream.latency_ms,
            weight_names=stream.weight_names,
        )
        ended = await sent(socket.send_text(ready))
        return ended or await Session(socket, self._house, opening, stream).run()
