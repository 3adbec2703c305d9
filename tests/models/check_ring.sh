#!/bin/sh
# Checks the model of the ring: the protocol as it is must have no error in a complete search, and each deliberately wrong
# variant must have one, which shows that the assertions can fail. Works in a directory of its own.
# Usage: check_ring.sh MODEL; exit status 77 where Spin is not installed (ctest takes that as skipped).
set -eu

if ! command -v spin >/dev/null 2>&1; then
    echo "Spin is not installed, nothing was checked. To install it: sudo apt-get install spin"
    exit 77
fi
model=$(realpath "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

# search NAME FLAGS...: a full search of the model with these definitions; its answer in NAME.log.
search() {
    name=$1
    shift
    spin "$@" -a "$model" >"$name.spin" 2>&1 || { cat "$name.spin"; exit 1; }
    ${CC:-cc} -O1 -w -DSAFETY -DMEMLIM=2000 -o pan pan.c
    ./pan -m200000 >"$name.log" 2>&1 || true
}
errors() { sed -n 's/.*errors: \([0-9][0-9]*\).*/\1/p' "$1.log"; }
states() { sed -n 's/^ *\([0-9.e+]*\) states, stored.*/\1/p' "$1.log"; }
reason() { sed -n 's/^pan:[0-9]*: \(.*\) (at depth.*/\1/p' "$1.log" | head -n 1; }

failed=0
for slots in 2 3; do
    search "right-$slots" -DSLOTS=$slots
    if [ "$(errors "right-$slots")" = 0 ] && ! grep -qE 'max search depth too small|Search not completed|out of memory' "right-$slots.log"; then
        echo "proved   the protocol with $slots slots: whole, rising, found; complete search of $(states "right-$slots") states"
    else
        echo "FAILED   the protocol with $slots slots: $(reason "right-$slots")"
        cat "right-$slots.log"
        failed=1
    fi
done

# refuted VARIANT WHAT-IT-DOES FLAGS...
refuted() {
    variant=$1
    what=$2
    shift 2
    search "$variant" "$@"
    if [ "$(errors "$variant")" = 1 ] && [ -n "$(reason "$variant")" ]; then
        echo "refuted  $what: $(reason "$variant")"
    else
        echo "FAILED   $what: no error was found, so the assertions prove nothing"
        cat "$variant.log"
        failed=1
    fi
}
refuted one-slot "one slot only" -DSLOTS=1
refuted head-first "head moved before the slot is complete" -DWRONG_HEAD_FIRST
refuted no-odd "the slot not marked while it is written" -DWRONG_NO_ODD_STAMP
refuted words-last "stamp and head stored before the words" -DWRONG_WORDS_LAST
refuted no-second-look "a reader that does not look at the stamp again" -DWRONG_NO_SECOND_LOOK
refuted trusting "a takeover that announces a half-written slot" -DWRONG_TAKEOVER_TRUSTS_SLOT
refuted again "a takeover that counts from 1 again" -DWRONG_TAKEOVER_STARTS_AGAIN
exit $failed
