"""`facecode serve`: a page and a socket for faces that speak while they listen."""

from __future__ import annotations

import argparse
import os

import facecode
from facecode.cli.options import (
    Commands,
    add_bundle,
    add_compute,
    add_quiet,
    compute_of,
    positive,
)
from facecode.errors import MissingExtraError
from facecode.session import usable_cores

SESSIONS_PER_CORE = 1
"""So many were served without a frame left out on a machine that had other work; see
docs/serve.md."""
TOKEN = "FACECODE_TOKEN"


def add_parser(commands: Commands) -> argparse.ArgumentParser:
    """The sub-command `serve`, with `run` set."""
    parser = commands.add_parser(
        "serve", help="serve a page whose head speaks with you, and faces for other programs"
    )
    parser.set_defaults(run=run_serve)
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="where to listen, as in --host 0.0.0.0 for everybody (default: 127.0.0.1, this "
        "machine alone)",
    )
    parser.add_argument(
        "--port",
        type=int,
        default=8765,
        metavar="N",
        help="as in --port 8080; 0: a free one (default: 8765)",
    )
    _add_limits(parser)
    _add_access(parser)
    add_bundle(parser)
    add_compute(parser, threads=1)
    parser.add_argument(
        "--workers",
        type=positive(int),
        metavar="N",
        help="sessions that are computed at the same moment, as in --workers 4 (default: one for "
        "each core)",
    )
    add_quiet(parser)
    return parser


def _add_limits(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--sessions",
        type=positive(int),
        metavar="N",
        help="at once, as in --sessions 8; one more is answered 'busy' (default: "
        "one for each core)",
    )
    parser.add_argument(
        "--seconds",
        type=positive(float),
        metavar="S",
        default=600.0,
        help="that a session lasts at most, as in --seconds 3600 (default: 600)",
    )
    parser.add_argument(
        "--idle",
        type=positive(float),
        metavar="S",
        default=30.0,
        help="seconds without a message that end a session, as in --idle 10 (default: 30)",
    )
    parser.add_argument(
        "--message-bytes",
        type=positive(int),
        metavar="N",
        default=256 * 1024,
        help="of one message at most, as in --message-bytes 65536 (default: 262144)",
    )


def _add_access(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--origin",
        action="append",
        default=[],
        metavar="URL",
        help="a page that may use the server beside its own, as in --origin https://example.com; "
        "may be given several times",
    )
    parser.add_argument(
        "--token",
        metavar="TEXT",
        default=os.environ.get(TOKEN),
        help="what clients must know, as in --token s3cret; others on this machine can read it, "
        f"unlike the variable {TOKEN} (default: what that variable holds)",
    )


def run_serve(args: argparse.Namespace) -> None:
    """`facecode serve`: until it is interrupted."""
    try:
        from facecode.serve.app import build_app
        from facecode.serve.server import listen, server_of, url_of
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ("starlette", "uvicorn", "websockets"):
            raise
        raise MissingExtraError.of("facecode serve", str(error.name), "serve") from error
    from facecode.serve.access import Access
    from facecode.serve.heads import Heads
    from facecode.serve.house import House
    from facecode.serve.limits import Limits

    access = Access(args.host, tuple(args.origin), args.token or None)
    sessions = args.sessions or SESSIONS_PER_CORE * usable_cores()
    limits = Limits(sessions, args.seconds, args.idle, args.message_bytes)
    with listen(args.host, args.port) as listening:
        face = facecode.load(args.bundle, compute=compute_of(args))
        house = House(face, limits, args.workers or usable_cores())
        app = build_app(house, Heads(face, args.template), access)
        if not args.quiet:
            fragment = "#token=..." if access.token else ""
            print(f"{url_of(listening)}{fragment}", flush=True)
        server_of(app, limits).run(sockets=[listening])
