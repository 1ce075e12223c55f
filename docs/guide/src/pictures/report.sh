#!/usr/bin/env bash
# Makes report.png: simulates the complete robot with effects that the model lacks, and reports on the model without them.
set -euo pipefail
cd "$(dirname "$0")/../../../.."
run() { cargo run --quiet --release -- "$@"; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for which in fit check; do
    run simulate model-spec/rigs/spidermill-worn.toml --seed 1 \
        --trajectory "recordings/spidermill-mbs/plain-$which.csv" --out "$folder/$which.csv"
done
run report model-spec/models/spidermill.toml --data "$folder/fit.csv" --check "$folder/check.csv" --out "$folder"
sed -i "s#$folder/##g" "$folder/report.html"
chromium --headless --no-sandbox --disable-gpu --hide-scrollbars --window-size=1100,1480 --virtual-time-budget=3000 \
    --screenshot="$PWD/docs/guide/src/pictures/report.png" "file://$folder/report.html"
