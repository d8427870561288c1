#!/bin/sh
# Makes tests/data/tiny-bundle and tests/data/tiny-faceformer: random weights (seed 0) of the systems
# codetalker-tiny and faceformer-tiny on a sphere, the second with three face units.
set -eu
data=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python -c "
import sys, numpy, trimesh
sphere = trimesh.creation.icosphere(subdivisions=1, radius=0.1)
sphere.export(sys.argv[1] + '/sphere.ply')
deltas = numpy.random.default_rng(0).standard_normal((3, len(sphere.vertices), 3)) / 100
names = ['jawOpen', 'mouthSmileLeft', 'browInnerUp']
numpy.savez(sys.argv[1] + '/units.npz', names=names, deltas=deltas)
" "$work"
facecode-export init --system codetalker-tiny --seed 0 --out "$work/checkpoints"
facecode-export export --system codetalker-tiny --template "$work/sphere.ply" \
    --stage1 "$work/checkpoints/stage1.pth.tar" --stage2 "$work/checkpoints/stage2.pth.tar" \
    --out "$data/tiny-bundle"
facecode-export init --system faceformer-tiny --seed 0 --out "$work/faceformer"
facecode-export export --system faceformer-tiny --template "$work/sphere.ply" \
    --checkpoint "$work/faceformer/faceformer.pth" --units "$work/units.npz" \
    --out "$data/tiny-faceformer"
