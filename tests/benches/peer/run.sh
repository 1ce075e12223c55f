#!/bin/sh
# Builds and runs the peer benchmark: Pinocchio's inverse dynamics of the Panda, nanoseconds per call.
# It is no part of CI. It makes a virtual environment in the folder given (default: a temporary one) and needs python3,
# g++ and a network:
#
#     tests/benches/peer/run.sh [folder]
#
# Run it right before or after `cargo bench -p modelmill-tests`, so that both see the same machine.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=${1:-$(mktemp -d)}
[ -x "$work/bin/pip" ] || python3 -m venv "$work"
"$work/bin/pip" install --quiet pin==4.1.0 cmeel-eigen
prefix=$(dirname "$(find "$work" -path '*cmeel.prefix/include' -type d | head -n 1)")
# Pinocchio has more kinds of joints than Boost lists hold by default.
g++ -std=c++17 -O3 -march=native -DNDEBUG \
    -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS -DBOOST_MPL_LIMIT_LIST_SIZE=30 -DBOOST_MPL_LIMIT_VECTOR_SIZE=30 -DBOOST_FUSION_INVOKE_MAX_ARITY=12 \
    -I"$prefix/include" -I"$prefix/include/eigen3" \
    "$here/rnea.cpp" -L"$prefix/lib" -lpinocchio_default -Wl,-rpath,"$prefix/lib" -o "$work/rnea"
"$work/rnea" "$here/../../fixtures/reference"
