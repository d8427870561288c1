"""`facecode live`: a microphone, or raw samples on standard input, to weights as they come."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator

import facecode
from facecode.cli.options import (
    STANDARD_STREAM,
    Commands,
    add_bundle,
    add_compute,
    add_look_ahead,
    add_quiet,
    add_style,
    compute_of,
    positive,
)
from facecode.errors import AddressError, NoRigError
from facecode.live.drive import frames_of, keep_up
from facecode.live.frame import LiveFrame
from facecode.live.sinks import Sink, json_lines, live_link, vmc
from facecode.live.sources import DTYPES, microphone_chunks, pipe_chunks
from facecode.live.stream import Stream
from facecode.options import parse_style


def add_parser(commands: Commands) -> argparse.ArgumentParser:
    """The sub-command `live`, with `run` set."""
    live = commands.add_parser("live", help="drive a face while somebody speaks")
    live.set_defaults(run=run_live)
    live.add_argument(
        "source",
        nargs="?",
        choices=["microphone", STANDARD_STREAM],
        default="microphone",
        help="the microphone (extra live), or - for raw samples on standard input",
    )
    live.add_argument("--device", metavar="NAME", help="the microphone, as in --device USB")
    live.add_argument(
        "--rate",
        type=positive(int),
        default=16_000,
        metavar="HZ",
        help="samples a second, as in --rate 48000 (default: 16000)",
    )
    live.add_argument(
        "--channels", type=positive(int), default=1, metavar="N", help="on stdin (default: 1)"
    )
    live.add_argument(
        "--samples-as",
        choices=list(DTYPES),
        default="s16",
        help="on stdin: little-endian integers of 16 bits, or floats of 32 (default: s16)",
    )
    _add_targets(live)
    add_bundle(live)
    add_style(live)
    add_look_ahead(live)
    live.add_argument(
        "--rest-in-quiet",
        action="store_true",
        help="draw the face to rest where nobody speaks, and let it blink",
    )
    add_compute(live)
    add_quiet(live)
    return live


def _add_targets(live: argparse.ArgumentParser) -> None:
    live.add_argument(
        "--udp",
        type=_address,
        metavar="HOST:PORT",
        help="send packets of Live Link Face, as in --udp 127.0.0.1:11111 for Unreal",
    )
    live.add_argument(
        "--osc",
        type=_address,
        metavar="HOST:PORT",
        help="send messages of VMC, as in --osc 127.0.0.1:39539 (extra live)",
    )


def _address(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not port.isdecimal() or not 0 < int(port) < 1 << 16:
        raise argparse.ArgumentTypeError(f"expected HOST:PORT, got {text}")
    return host.strip("[]"), int(port)


def run_live(args: argparse.Namespace) -> None:
    """`facecode live`."""
    face = facecode.load(args.bundle, compute=compute_of(args))
    if not face.gives_weights:
        raise NoRigError.to_write("weights")
    stream = face.stream(
        parse_style(args.style), look_ahead_ms=args.look_ahead, rest_in_quiet=args.rest_in_quiet
    )
    sinks = _sinks(args, stream)
    if not args.quiet:
        print(f"facecode: latency {stream.latency_ms:.0f} ms and computing", file=sys.stderr)
    n_frames = 0
    for frame in _frames(args, stream):
        assert frame.weights is not None, "the bundle has units"
        for sink in sinks:
            try:
                sink(frame, frame.weights)
            except ConnectionError as error:
                if isinstance(error, BrokenPipeError):
                    raise
                raise AddressError(f"sending failed: {error}; is the receiver there?") from error
        n_frames += 1
    if not args.quiet:
        print(f"facecode: {n_frames} frames, {stream.n_skipped} left out", file=sys.stderr)


def _sinks(args: argparse.Namespace, stream: Stream) -> list[Sink]:
    sinks = []
    if args.udp is not None:
        sinks.append(live_link(stream, args.udp))
    if args.osc is not None:
        sinks.append(vmc(stream, args.osc))
    return sinks or [json_lines(stream, sys.stdout)]


def _frames(args: argparse.Namespace, stream: Stream) -> Iterator[LiveFrame]:
    if args.source == STANDARD_STREAM:
        chunks = pipe_chunks(sys.stdin.buffer, args.samples_as, args.channels)
        yield from frames_of(stream, chunks, args.rate)
    else:
        with microphone_chunks(args.rate, args.device) as heard:
            yield from keep_up(stream, heard, args.rate)
