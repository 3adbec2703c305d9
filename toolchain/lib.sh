# shellcheck shell=bash
# Functions that the scripts of this folder share. Sourced, not run.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

say() { printf '==> %s\n' "$*"; }
die() {
    printf 'error: %s\n' "$*" >&2
    exit 1
}

# packages_of GROUP...: prints the packages of these groups, one a line, without those whose command already exists.
packages_of() {
    local groups="$*" package command
    awk -v groups="$groups" 'BEGIN { n = split(groups, g, " "); for (i = 1; i <= n; i++) wanted[g[i]] = 1 }
                             /^[^#]/ && ($1 in wanted) { print $2, $3 }' "$root/toolchain/packages.txt" |
        while read -r package command; do
            [ -n "$command" ] && command -v "$command" >/dev/null || echo "$package"
        done
}

# need GROUP...: installs the missing packages of these groups and names them. Quick and silent if none is missing.
need() {
    local missing=() package
    while read -r package; do
        [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || missing+=("$package")
    done < <(packages_of "$@")
    [ ${#missing[@]} -gt 0 ] || return 0
    say "Installing ${#missing[@]} Debian packages: ${missing[*]}"
    local as_root=()
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null || die "not root and no sudo: run as root: apt-get install ${missing[*]}"
        as_root=(sudo)
    fi
    local log
    log=$(mktemp)
    "${as_root[@]}" apt-get update >"$log" 2>&1 || { tail -n 5 "$log" >&2; die "apt-get update failed"; }
    DEBIAN_FRONTEND=noninteractive "${as_root[@]}" apt-get install -y --no-install-recommends "${missing[@]}" \
        >"$log" 2>&1 || {
        tail -n 8 "$log" >&2
        case "${missing[*]}" in
            *clang-*22*) die "apt-get could not install ${missing[*]} (clang 22 is in Debian's security suite: bookworm-security main)" ;;
            *) die "apt-get could not install ${missing[*]}" ;;
        esac
    }
    rm -f "$log"
}

# apt_for ARCHITECTURE FOLDER: makes a separate apt in FOLDER for the packages of ARCHITECTURE (arm64, ...) from this
# machine's sources, as if nothing were installed. Use it with APT_CONFIG=FOLDER/apt.conf. This machine's apt and dpkg are
# not changed and gain no foreign architecture.
apt_for() {
    local architecture=$1 folder=$2
    mkdir -p "$folder"/state/lists/partial "$folder"/cache/archives/partial
    touch "$folder/status"
    cat >"$folder/apt.conf" <<END
APT::Architecture "$architecture";
APT::Architectures { "$architecture"; };
Dir::State "$folder/state";
Dir::State::status "$folder/status";
Dir::Cache "$folder/cache";
END
    APT_CONFIG=$folder/apt.conf apt-get update >"$folder/update.log" 2>&1 ||
        { tail -n 5 "$folder/update.log" >&2; die "apt-get update for $architecture failed; do the sources have that architecture?"; }
}

# build PRESET [CMAKE-OPTION...] [-- TARGET...]: configures the preset and builds what has changed.
build() {
    local preset=$1 options=(-DHAPTIC_PRECOMPILE=ON) targets=()
    shift
    while [ $# -gt 0 ] && [ "$1" != -- ]; do
        options+=("$1")
        shift
    done
    [ $# -eq 0 ] || shift
    [ $# -eq 0 ] || targets=(--target "$@")
    say "Building (preset $preset, in build/$preset)"
    local log
    log=$(mktemp)
    (cd "$root" && cmake --preset "$preset" "${options[@]}") >"$log" 2>&1 || { cat "$log" >&2; die "cmake failed"; }
    sed -n 's/^-- \(.* without the live view: .*\)/    \1/p; s/^-- \(Without the tests of .*\)/    \1/p' "$log"
    (cd "$root" && cmake --build --preset "$preset" --parallel "$(nproc)" "${targets[@]}") >"$log" 2>&1 ||
        { grep -vE '^\[[0-9]+/[0-9]+\]' "$log" | tail -n 60 >&2; die "the build failed"; }
    rm -f "$log"
}
