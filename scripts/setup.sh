#!/usr/bin/env bash
# Prepares this checkout: the system's libraries, then .venv with the locked packages, then the kernels.
# Every step first looks whether it is needed, so a second run does nothing and takes a moment.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly VENV=.venv
readonly STAMPS=$VENV/halflight-setup
readonly PYTHON_PACKAGES=(python3 python3-venv)
# libgl1 and libegl1 are the fronts; libegl-mesa0 and libgl1-mesa-dri the driver, with software GL.
readonly EGL_PACKAGES=(libegl1 libgl1 libegl-mesa0 libgl1-mesa-dri)
# The viewer is tested in a real browser.
readonly BROWSER_PACKAGES=(chromium fonts-dejavu-core)
readonly BROWSERS=(chromium chromium-browser google-chrome)

usage() {
    cat <<'TEXT'
Usage: scripts/setup.sh [--system-only | --python-only] [--dev] [--dry-run]

Prepares this checkout to run halflight. Idempotent: what is in place is left alone.

  system part   Python 3.11 or newer with venv, and OpenGL through EGL (Mesa); what is missing is
                installed with apt-get where that is possible as root or by sudo without a
                password, and otherwise named, with a non-zero exit
  python part   .venv with the packages of requirements/run.lock, checked by their hashes; the
                project itself, editable; its kernels compiled

Options:
  --system-only   the system part alone
  --python-only   the python part alone
  --dev           with what tests and checks need: the system part with Chromium, the python part with
                  the packages of requirements/dev.lock
  --dry-run       show what would be done, check that the files it needs are there, and change nothing
  -h, --help      this text

Environment:
  PYTHON          the interpreter to use, instead of the first suitable one on PATH
TEXT
}

say() { printf '%s\n' "setup: $*" >&2; }
fail() { say "$@"; exit 1; }

# Runs a command, or only shows it.
run() {
    if [[ $dry_run == yes ]]; then
        say "would run: $*"
    else
        "$@"
    fi
}

# --- the system part ---------------------------------------------------------------------------------

# Prints the first interpreter that is new enough and can make virtual environments.
find_python() {
    local candidate
    for candidate in ${PYTHON:+"$PYTHON"} python3 python3.11 python3.12 python3.13 python3.14; do
        if "$candidate" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            command -v "$candidate"
            return 0
        fi
    done
    return 1
}

# Installs Debian packages, or says which ones to install: install_packages REASON PACKAGE...
install_packages() {
    local reason=$1 as_root=()
    shift
    if [[ $(id -u) != 0 ]]; then
        as_root=(sudo -n)
    fi
    if ! command -v apt-get >/dev/null; then
        fail "$reason. Install what Debian calls: $*"
    fi
    if ! "${as_root[@]}" true 2>/dev/null; then
        fail "$reason. Run as root, then try again: apt-get install $*"
    fi
    say "$reason: installing $*"
    run "${as_root[@]}" apt-get update -qq
    run "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y -qq --no-install-recommends "$@" >&2
}

set_up_system() {
    local python reason
    if ! python=$(find_python); then
        # Without Python EGL can't be tried either, so that all that may be missing is named at once.
        install_packages "no Python 3.11 or newer with venv" "${PYTHON_PACKAGES[@]}" "${EGL_PACKAGES[@]}"
        [[ $dry_run == yes ]] && return
        python=$(find_python) || fail "this system's Python is older than 3.11; name a newer one in PYTHON"
    fi
    if ! reason=$("$python" scripts/egl_probe.py); then
        install_packages "no OpenGL through EGL ($reason)" "${EGL_PACKAGES[@]}"
        [[ $dry_run == yes ]] && return
        reason=$("$python" scripts/egl_probe.py) || fail "EGL does not work even with ${EGL_PACKAGES[*]}: $reason"
    fi
    if [[ $dev == yes ]] && ! command -v "${BROWSERS[@]}" >/dev/null; then
        install_packages "no Chromium to test the viewer in" "${BROWSER_PACKAGES[@]}"
    fi
}

# --- the python part ---------------------------------------------------------------------------------

# Succeeds if a step was done with these very files: done_with STEP FILE...
done_with() {
    [[ -f $STAMPS/$1 && $(<"$STAMPS/$1") == "$(fingerprint "${@:2}")" ]]
}

mark_done() {
    [[ $dry_run == yes ]] && return
    mkdir -p "$STAMPS"
    fingerprint "${@:2}" >"$STAMPS/$1"
}

# A digest of this checkout's place (a virtual environment can't be moved) and of files' names and contents.
fingerprint() {
    { pwd; cat -- "$@"; printf '%s\n' "$@"; } | sha256sum
}

set_up_python() {
    local run_lock=requirements/run.lock dev_lock=requirements/dev.lock python file
    local pip=("$VENV/bin/python" -m pip --disable-pip-version-check install --quiet)
    for file in pyproject.toml README.md LICENSE "$run_lock" "$dev_lock" solver service halflight; do
        [[ -r $file ]] || fail "$file is missing"
    done

    # A virtual environment that was moved, or whose Python has gone, is made anew.
    if ! done_with venv /dev/null || ! "$VENV/bin/python" -c 'import pip' 2>/dev/null; then
        python=$(find_python) || fail "no Python 3.11 or newer with venv; run scripts/setup.sh --system-only"
        say "making $VENV with $("$python" -V)"
        run "$python" -m venv --clear "$VENV"
        mark_done venv /dev/null
    fi

    # All of run.lock is in dev.lock too, so that an environment for development serves as well.
    if [[ $dev == yes ]] && ! done_with packages-dev "$dev_lock"; then
        say "installing the packages of $dev_lock (some minutes)"
        run "${pip[@]}" --require-hashes -r "$dev_lock"
        mark_done packages-dev "$dev_lock"
    elif [[ $dev == no ]] && ! done_with packages "$run_lock" && ! done_with packages-dev "$dev_lock"; then
        say "installing the packages of $run_lock (some minutes)"
        run "${pip[@]}" --require-hashes -r "$run_lock"
        mark_done packages "$run_lock"
    fi

    if ! done_with project pyproject.toml; then
        run env PYTHONWARNINGS=ignore "${pip[@]}" --no-deps --no-build-isolation --editable .
        mark_done project pyproject.toml
    fi

    local sources
    mapfile -t sources < <(find solver halflight -name '*.py' | LC_ALL=C sort)
    if ! done_with kernels "$run_lock" "${sources[@]}"; then
        say "compiling the kernels (those that did not change are kept)"
        run "$VENV/bin/halflight" warm
        mark_done kernels "$run_lock" "${sources[@]}"
    fi
}

# --- the command line --------------------------------------------------------------------------------

parts=both dev=no dry_run=no
for argument in "$@"; do
    case $argument in
        --system-only | --python-only)
            [[ $parts == both ]] || { usage >&2; fail "--system-only and --python-only exclude each other"; }
            parts=$argument
            ;;
        --dev) dev=yes ;;
        --dry-run) dry_run=yes ;;
        -h | --help) usage; exit 0 ;;
        *) usage >&2; fail "unknown option: $argument" ;;
    esac
done
readonly parts dev dry_run

# One set-up of a checkout at a time.
if command -v flock >/dev/null; then
    exec 9<scripts
    flock 9
fi
if [[ $parts != --python-only ]]; then set_up_system; fi
if [[ $parts != --system-only ]]; then set_up_python; fi
