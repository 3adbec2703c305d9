#!/usr/bin/env python3
"""Compares the ABI of an installed libhaptic.so with a list: check_abi.py PREFIX LIST

Compared are the name that programs ask for, the version and sizes of the frames, the libraries that it needs, and the
exported symbols, which are also the functions that haptic.h declares.
"""
import ctypes
import re
import subprocess
import sys
import tempfile
from pathlib import Path

sys.dont_write_bytecode = True  # nothing is written to the source tree
import libhaptic


def readelf(*arguments: str) -> list[str]:
    return subprocess.run(["readelf", "-W", *arguments], check=True, capture_output=True, text=True).stdout.splitlines()


def sizes(include: Path) -> set[str]:
    """What a C compiler makes of the installed headers."""
    types = ("haptic_contact_frame", "haptic_device_state", "haptic_peer")
    prints = "".join(f'printf("size {name} %zu\\n", sizeof({name}));' for name in types)
    source = f"#include <haptic/haptic.h>\n#include <stdio.h>\nint main(void) {{ {prints} return 0; }}\n"
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "sizes"
        subprocess.run(["cc", f"-I{include}", "-x", "c", "-", "-o", program], input=source, check=True, text=True)
        return set(subprocess.run([program], check=True, capture_output=True, text=True).stdout.splitlines())


def abi_of(prefix: Path) -> set[str]:
    library = libhaptic.find_library(prefix)
    found = sizes(prefix / "include") | {f"frames {libhaptic.load(library).haptic_abi_version()}"}
    for line in readelf("--dynamic", str(library)):
        if match := re.search(r"\((NEEDED|SONAME)\).*\[(.*)\]", line):
            name = re.sub(r"^ld-linux.*", "ld-linux", match[2])
            found.add(("soname " if match[1] == "SONAME" else "needs ") + name)
    for line in readelf("--dyn-syms", str(library)):
        fields = line.split()
        # Number, value, size, type, binding, visibility, section, name. The node of a version is an absolute symbol.
        if len(fields) == 8 and fields[4] in ("GLOBAL", "WEAK", "UNIQUE") and fields[6] not in ("UND", "ABS"):
            found.add("symbol " + fields[7])
    return found


def main() -> None:
    prefix, listed_in = Path(sys.argv[1]), Path(sys.argv[2])
    listed = {line for line in listed_in.read_text().splitlines() if line and not line.startswith("#")}
    found = abi_of(prefix)
    problems = [f"{listed_in.name} has, but the library has not: {line}" for line in sorted(listed - found)]
    problems += [f"the library has, but {listed_in.name} has not: {line}" for line in sorted(found - listed)]

    header = re.sub(r"/\*.*?\*/", "", (prefix / "include/haptic/haptic.h").read_text(), flags=re.DOTALL)
    declared = set(re.findall(r"\b(haptic_\w+)\(", header))
    exported = {line.split()[1].split("@")[0] for line in found if line.startswith("symbol ")}
    problems += [f"haptic.h declares {name}, which is not exported" for name in sorted(declared - exported)]
    problems += [f"{name} is exported, but haptic.h does not declare it" for name in sorted(exported - declared)]

    # Python's own structures are a third description of the layout.
    for name, structure in (("haptic_contact_frame", libhaptic.ContactFrame), ("haptic_device_state", libhaptic.DeviceState)):
        if f"size {name} {ctypes.sizeof(structure)}" not in found:
            problems.append(f"libhaptic.py describes {name} with {ctypes.sizeof(structure)} bytes")
    sys.exit("\n".join(problems) or 0)


if __name__ == "__main__":
    main()
