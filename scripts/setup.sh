#!/usr/bin/env bash
# Makes the virtual environment .venv with everything that `make demo` and `make test` need.
# The second run sees that nothing has changed and ends at once.
#
#   PYTHON                 interpreter to use (default: python3, or python3.12, 3.11, 3.10 where that is too old or new)
#   VENV                   where the environment goes (default: .venv)
#   TR_GRASP_TORCH_INDEX   an index of CPU wheels to take torch from; without it pip's own settings decide,
#                          which usually means a CUDA build of some gigabytes
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

VENV=${VENV:-.venv}
STAMP=$VENV/.tr-grasp-setup
LOG=$VENV/setup.log

say() { printf 'setup: %s\n' "$*"; }
fail() { printf 'setup: %s\n' "$*" >&2; exit 1; }

supported() { "$1" -c 'import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 12))' 2>/dev/null; }

find_python() {
  local candidate
  for candidate in ${PYTHON:-python3 python3.12 python3.11 python3.10}; do
    if supported "$candidate"; then command -v "$candidate"; return; fi
  done
  fail "no Python 3.10, 3.11 or 3.12 found${PYTHON:+ as $PYTHON}; install one (Debian, Ubuntu: apt-get install python3 python3-venv) or name it: PYTHON=/path/to/python3.11 make setup"
}

# What decides the environment: the wanted packages, this script, the interpreter, the place.
fingerprint() {
  { cat pyproject.toml constraints.txt scripts/setup.sh; "$1" -VV; printf '%s\n' "$PWD/$VENV" "${TR_GRASP_TORCH_INDEX:-}"; } \
    | sha256sum | cut -d' ' -f1
}

may_be_root() { [ "$(id -u)" -eq 0 ] || { command -v sudo >/dev/null && sudo -n true 2>/dev/null; }; }

as_root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo -n "$@"; fi; }

# apt_install WHY PACKAGE...: installs, or says in one sentence what a person must do.
apt_install() {
  local why=$1; shift
  if command -v apt-get >/dev/null && may_be_root; then
    say "installing system packages: $*"
    if as_root env DEBIAN_FRONTEND=noninteractive sh -c \
      'apt-get update -qq && apt-get install -y -qq --no-install-recommends "$@"' sh "$@" >"$APT_LOG" 2>&1; then return 0; fi
    tail -n 3 "$APT_LOG" >&2
  fi
  printf 'setup: %s; please run: sudo apt-get update && sudo apt-get install -y %s\n' "$why" "$*" >&2
  return 1
}

# The table of shared libraries is the doctor's; it needs nothing but the standard library.
missing_packages() {
  [ "$(uname -s)" = Linux ] || return 0
  "$1" - <<'PYTHON'
from tr_grasp.doctor import SYSTEM_LIBRARIES
from tr_grasp.doctor.probe import probe_libraries

missing = probe_libraries()
print(*dict.fromkeys(library.package for library in SYSTEM_LIBRARIES if library.soname in missing))
PYTHON
}

make_venv() {
  if [ -x "$VENV/bin/python" ] && "$VENV/bin/python" -m pip --version >/dev/null 2>&1 &&
    [ "$("$VENV/bin/python" -VV)" = "$("$1" -VV)" ]; then return; fi
  say "making $VENV with $("$1" --version)"
  if ! "$1" -c 'import ensurepip, venv' 2>/dev/null; then
    apt_install "this Python lacks its venv module" python3-venv || exit 1
  fi
  "$1" -m venv --clear "$VENV" || fail "could not make $VENV; remove it and try again"
}

pip_install() {
  "$VENV/bin/python" -m pip install --disable-pip-version-check --no-input -c constraints.txt "$@" >>"$LOG" 2>&1 || {
    tail -n 20 "$LOG" >&2
    fail "pip could not install $*; the lines above and $LOG say why; run the same command again to go on from here"
  }
}

install_torch() {
  local index=()
  if [ -n "${TR_GRASP_TORCH_INDEX:-}" ]; then index=(--index-url "$TR_GRASP_TORCH_INDEX"); fi
  if "$VENV/bin/python" -c 'import torch' 2>/dev/null; then return; fi
  if [ ${#index[@]} -eq 0 ] && ! command -v nvidia-smi >/dev/null; then
    say "installing torch (no GPU here: TR_GRASP_TORCH_INDEX=<index of CPU wheels> may save gigabytes)"
  else
    say "installing torch"
  fi
  # First and alone: asked for by another package, torch comes as whatever the newest CUDA build is.
  pip_install "${index[@]}" "$(sed -n 's/^\(torch==[^ ;]*\).*/\1/p' constraints.txt)"
}

python=$(find_python)
wanted=$(fingerprint "$python")
if [ -x "$VENV/bin/python" ] && [ "$(cat "$STAMP" 2>/dev/null)" = "$wanted" ]; then exit 0; fi

APT_LOG=$(mktemp)
trap 'rm -f "$APT_LOG"' EXIT
started=$(date +%s)
packages=$(missing_packages "$python")
if [ -n "$packages" ]; then
  # Not fatal: what is missing may be optional, and the doctor knows.
  # shellcheck disable=SC2086 -- the names are separate words
  apt_install "some shared libraries are missing" $packages || true
fi
make_venv "$python"
rm -f "$STAMP"
: >"$LOG"
say "the first time takes some minutes; details go to $LOG"
install_torch
say "installing the project and its dependencies"
pip_install -e '.[dev]'
# The tests compare with this library. It asks for torchvision, which it hardly uses and which would bring another torch.
pip_install --no-deps "$(sed -n 's/^# without its dependencies: \(ocnn==.*\)/\1/p' constraints.txt)"
printf '%s\n' "$wanted" >"$STAMP"
say "done in $(($(date +%s) - started)) s"
