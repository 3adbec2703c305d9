# shellcheck shell=bash
# Functions that the scripts of this folder share. Sourced, not run.
set -euo pipefail
# --help of the script that sources this: the comment at its head.
case ${1:-} in -h | --help) sed -n '2,${/^#/!q;s/^# \{0,1\}//p}' "$0"; exit 0 ;; esac
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

say() { printf '==> %s\n' "$*"; }
die() {
    printf 'error: %s\n' "$*" >&2
    exit 1
}

# packages_of GROUP...: prints the packages of these groups, one a line, without those whose command already exists, each with
# what is lost without it.
packages_of() {
    local groups="$*" package command lost
    awk -v groups="$groups" 'BEGIN { n = split(groups, g, " "); for (i = 1; i <= n; i++) wanted[g[i]] = 1 }
                             /^[^#]/ && ($1 in wanted) { $1 = ""; print }' "$root/toolchain/packages.txt" |
        while read -r package command lost; do
            [ "${command:--}" != - ] && command -v "$command" >/dev/null || echo "$package $lost"
        done
}

# missing_of GROUP...: the same, without those that are installed.
missing_of() {
    packages_of "$@" | while read -r package lost; do
        [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || echo "$package $lost"
    done
}

# as_root COMMAND...: through sudo where necessary; fails without either.
as_root() {
    if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi
}

# try_install LOG PACKAGE...: installs Debian packages. On failure prints why, in one line.
try_install() {
    local log=$1 brief=(-o Acquire::Retries=0 -o Acquire::http::Timeout=20 -o Acquire::https::Timeout=20)
    shift
    if [ "$(id -u)" -ne 0 ] && ! command -v sudo >/dev/null; then
        echo "not root and no sudo"
        return 1
    fi
    as_root apt-get update "${brief[@]}" >"$log" 2>&1 || true # what it knew before may do
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "${brief[@]}" "$@" >>"$log" 2>&1 && return 0
    if grep -qi 'certificate' "$log"; then
        echo "this network has a certificate of its own, which update-ca-certificates must know (/usr/local/share/ca-certificates)"
    elif grep -qiE 'could not (resolve|connect)|temporary failure|unreachable|failed to fetch|connection (failed|timed out)' "$log"; then
        echo "Debian's servers cannot be reached"
    elif [[ "$*" == *clang-*22* ]]; then
        echo "clang 22 is in Debian's security suite: bookworm-security main"
    else
        grep '^E:' "$log" | tail -n 1
    fi
    return 1
}

# need GROUP...: installs the missing packages of these groups and names them. Quick and silent if none is missing. If they
# cannot be installed: goes on without those that packages.txt can do without, and says what is lost.
need() {
    local missing=() package lost why log
    mapfile -t missing < <(missing_of "$@")
    [ ${#missing[@]} -gt 0 ] || return 0
    local names=("${missing[@]%% *}")
    say "Installing ${#names[@]} Debian packages: ${names[*]}"
    log=$(mktemp)
    if why=$(try_install "$log" "${names[@]}"); then
        rm -f "$log"
        return 0
    fi
    # One at a time what is possible: apt installs all of a list or nothing.
    for package in "${names[@]}"; do
        as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends --no-download "$package" >>"$log" 2>&1 || true
    done
    local required=() without=()
    while read -r package lost; do
        if [ -n "$lost" ]; then without+=("$lost"); else required+=("$package"); fi
    done < <(missing_of "$@")
    [ ${#required[@]} -eq 0 ] || die "missing: ${required[*]} ($why). Install them, then run this again; apt's words are in $log"
    [ ${#without[@]} -eq 0 ] || say "Going on without $(printf '%s\n' "${without[@]}" | awk '!seen[$0]++' | paste -sd, | sed 's/,/, /g'): $why"
}

# apt_for ARCHITECTURE FOLDER [SUITE]: makes a separate apt in FOLDER for the packages of ARCHITECTURE (arm64, ...) from this
# machine's sources, or from Debian's SUITE (trixie, ...) alone, as if nothing were installed. Use it with
# APT_CONFIG=FOLDER/apt.conf. This machine's apt and dpkg are not changed and gain no foreign architecture.
apt_for() {
    local architecture=$1 folder=$2 suite=${3:-}
    mkdir -p "$folder"/state/lists/partial "$folder"/cache/archives/partial
    touch "$folder/status"
    cat >"$folder/apt.conf" <<END
APT::Architecture "$architecture";
APT::Architectures { "$architecture"; };
Dir::State "$folder/state";
Dir::State::status "$folder/status";
Dir::Cache "$folder/cache";
END
    if [ -n "$suite" ]; then
        printf 'deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian %s main\n' "$suite" >"$folder/sources.list"
        printf 'Dir::Etc::sourcelist "%s/sources.list";\nDir::Etc::sourceparts "-";\n' "$folder" >>"$folder/apt.conf"
    fi
    APT_CONFIG=$folder/apt.conf apt-get update >"$folder/update.log" 2>&1 ||
        { tail -n 5 "$folder/update.log" >&2; die "apt-get update for $architecture${suite:+ of $suite} failed; do the sources have that architecture?"; }
}

# draw_plot: runs gnuplot with the commands on standard input, in the style of all plots.
draw_plot() { cat "$root/shared/page/plot.gp" - | LC_ALL=C.UTF-8 gnuplot -d; }

# progress: shows how far ninja is, from its lines "[done/all] ...": on a terminal in one line, otherwise each tenth.
progress() {
    local terminal=0
    [ ! -t 1 ] || terminal=1
    awk -v terminal="$terminal" '
        match($0, /^\[[0-9]+\/[0-9]+\]/) {
            split(substr($0, 2, RLENGTH - 2), n, "/")
            if (terminal) { printf "\r    %d of %d", n[1], n[2]; shown = 1 }
            else if (n[2] > 20 && int(10 * n[1] / n[2]) > tenth) { tenth = int(10 * n[1] / n[2]); print "    " n[1] " of " n[2] }
            fflush()
        }
        END { if (shown) printf "\r%30s\r", "" }'
}

# count DONE ALL WORK: shows on a terminal how much of a long work is done; DONE 0 of 0 clears the line. Elsewhere nothing.
count() {
    [ -t 2 ] || return 0
    if [ "$2" -eq 0 ]; then printf '\r\033[K' >&2; else printf '%s: %d of %d\033[K\r' "$3" "$1" "$2" >&2; fi
}

# wait_with_clock WORK PROCESS...: waits for processes, and shows on a terminal for how long. Fails if one has failed.
wait_with_clock() {
    local work=$1 failed=0 begin=$SECONDS process
    shift
    for process in "$@"; do
        while [ -t 2 ] && kill -0 "$process" 2>/dev/null; do
            printf '%s: %d min\033[K\r' "$work" $(((SECONDS - begin) / 60)) >&2
            sleep 1
        done
        wait "$process" || failed=1
    done
    count 0 0
    return $failed
}

# in_large_pages COMMAND...: runs it with its memory in large pages (glibc 2.35 or newer): clang takes a tenth less time.
in_large_pages() { GLIBC_TUNABLES=glibc.malloc.hugetlb=1 "$@"; }

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
    sed -n 's/^-- \(.* without the live view: .*\)/    \1/p; s/^-- \(Without the tests of .*\)/    \1/p; s/^-- \(the \(Python package\|link to other machines\) is not built.*\)/    \1/p' "$log"
    (cd "$root" && in_large_pages cmake --build --preset "$preset" --parallel "$(nproc)" "${targets[@]}") 2>&1 | tee "$log" | progress ||
        { grep -vE '^\[[0-9]+/[0-9]+\]' "$log" | tail -n 60 >&2; die "the build failed"; }
    rm -f "$log"
}
