#!/bin/sh
# Makes tests/data/tiny-bundle: random weights (seed 0) of the system codetalker-tiny on a sphere.
set -eu
data=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python -c "
import sys, trimesh
trimesh.creation.icosphere(subdivisions=1, radius=0.1).export(sys.argv[1])
" "$work/sphere.ply"
facecode-export init --system codetalker-tiny --seed 0 --out "$work/checkpoints"
facecode-export export --system codetalker-tiny --template "$work/sphere.ply" \
    --stage1 "$work/checkpoints/stage1.pth.tar" --stage2 "$work/checkpoints/stage2.pth.tar" \
    --out "$data/tiny-bundle"
