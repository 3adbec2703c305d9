#!/usr/bin/env python3
"""Haptic.m in GNU Octave: each field that it writes and reads against libhaptic's structures, its errors, and that it
leaves its session however it ends."""
import argparse
import ctypes
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

sys.dont_write_bytecode = True  # nothing is written to the source tree
from libhaptic import ContactFrame, DeviceState, expect, find_library, load

EXAMPLE = Path(__file__).resolve().parents[2] / "shared/examples/12-matlab"
STRICT = "-Wall -Wextra -Wpedantic -Wshadow -Werror"
# A frame in which every number of the same kind differs from the others, and compliance that an elastic tool can have.
FRAME = """
f = Haptic.frame(64); i = 100 * (0:63);
f.state_sequence = intmax('uint64') - 11; f.state_time_ns = intmax('int64') - 12; f.plane_time_ns = -13;
f.step_ns = uint32(14); f.stiffness = 15; f.torque_stiffness = 16; f.static_friction = 18; f.dynamic_friction = 17;
f.body_work = 19; f.flags = Haptic.SQUEEZED + Haptic.HOLD_POSITIONS;
f.rest_offset = [i; i + 1; i + 2]; f.position = [i + 3; i + 4; i + 5]; f.rest_velocity = [i + 6; i + 7; i + 8];
f.radius = 0.125 * (0:63) + 0.0625; f.surface_velocity = [i + 9; i + 10; i + 11];
f.in_contact = Haptic.STICKS * ones(1, 64); f.in_contact(1) = Haptic.TOUCHES;
f.plane_count = uint32(3 * ones(1, 64));
f.plane_normal = repmat([1 0 0; 0 0 1; 0 -1 0], [1, 1, 64]);
f.plane_offset = [i + 12; i + 14; i + 16]; f.plane_velocity = [i + 13; i + 15; i + 17];
f.compliance = 2 * eye(192) + ((1:192)' * (1:192)) / 192^2;
"""

# Each must be refused with this identifier, and a message that has this pattern.
ERRORS = [
    ("Haptic('../x');", "notOpened", "session name"),
    ("Haptic(repmat('x', 1, 500));", "notOpened", "1 to 64"),
    ("Haptic(7);", "invalidArgument", "text, and not a double"),
    ("Haptic('x', 'watch');", "invalidArgument", "'observe'"),
    ("Haptic.frame(65);", "invalidArgument", "0 to 64 proxies"),
    ("Haptic.frame(1.5);", "invalidArgument", "0 to 64 proxies"),
    ("Haptic.frame([1 2]);", "invalidArgument", "0 to 64 proxies"),
    ("Haptic.frame(NaN);", "invalidArgument", "0 to 64 proxies"),
    ("s.wait(-1);", "invalidArgument", "seconds"),
    ("s.wait(0.1);", "timeout", "rt-core run --session"),
    ("s.publish(7);", "invalidFrame", "Haptic.frame"),
    ("s.publish([g g]);", "invalidFrame", "one structure"),
    ("s.publish(rmfield(g, 'stiffness'));", "invalidFrame", "frame.stiffness is missing"),
    ("s.publish(rmfield(g, 'position'));", "invalidFrame", "frame.position is missing"),
    ("g.stifness = 400; s.publish(g);", "invalidFrame", "frame.stifness is no field"),
    ("g.step_ns = 0; s.publish(g);", "invalidFrame", "step_ns"),
    ("g.stiffness = -1; s.publish(g);", "invalidFrame", "negative"),
    ("g.stiffness = NaN; s.publish(g);", "invalidFrame", r"not finite: frame.stiffness\(1, 1\) is NaN"),
    ("g.stiffness = single(1); s.publish(g);", "invalidFrame", "frame.stiffness .* double, is single"),
    ("g.stiffness = 1i; s.publish(g);", "invalidFrame", "frame.stiffness .* complex"),
    ("g.stiffness = sparse(1); s.publish(g);", "invalidFrame", "frame.stiffness .* sparse"),
    ("g.stiffness = '1'; s.publish(g);", "invalidFrame", "frame.stiffness .* is char"),
    ("g.plane_time_ns = NaN; s.publish(g);", "invalidFrame", r"frame.plane_time_ns\(1\), of class double, is no int64"),
    ("g.state_time_ns = 0.5; s.publish(g);", "invalidFrame", r"frame.state_time_ns\(1\), of class double, is no int64"),
    ("g.state_time_ns = 1e300; s.publish(g);", "invalidFrame", "is no int64"),
    ("g.state_time_ns = intmax('uint64'); s.publish(g);", "invalidFrame", "of class uint64, is no int64"),
    ("g.flags = intmax('uint64'); s.publish(g);", "invalidFrame", "is no uint32"),
    ("g.state_sequence = int64(-1); s.publish(g);", "invalidFrame", "is no uint64"),
    ("g.state_sequence = -1; s.publish(g);", "invalidFrame", "is no uint64"),
    ("g.flags = 2^32; s.publish(g);", "invalidFrame", "is no uint32"),
    ("g.flags = {1}; s.publish(g);", "invalidFrame", "frame.flags.* cell"),
    ("g.plane_count(2) = -1; s.publish(g);", "invalidFrame", r"frame.plane_count\(2\)"),
    ("g.plane_count(2) = 4; s.publish(g);", "invalidFrame", "HAPTIC_MAX_PLANES"),
    ("g.radius(2) = -0.01; s.publish(g);", "invalidFrame", "radius"),
    ("g.radius(2) = 11; s.publish(g);", "invalidFrame", "radius"),
    ("g.radius(2) = NaN; s.publish(g);", "invalidFrame", r"frame.radius\(1, 2\) is NaN"),
    ("g.position = [0 0 0]; s.publish(g);", "invalidFrame", "is 3 x 2, should be 3 x 3|is 1 x 3, should be 3 x 3"),
    ("g.position = zeros(4, 2); s.publish(g);", "invalidFrame", "frame.position is 4 x 2, should be 3 x 2"),
    ("g.position = zeros(3, 65); s.publish(g);", "invalidFrame", "65 columns: a frame has at most 64 proxies"),
    ("g.in_contact = [1; 1]; s.publish(g);", "invalidFrame", "frame.in_contact is 2 x 1, should be 1 x 2"),
    ("g.plane_normal = zeros(3, 3, 3); s.publish(g);", "invalidFrame", "frame.plane_normal is 3 x 3 x 3, should be 3 x 3 x 2"),
    ("g.plane_offset = zeros(2, 3); s.publish(g);", "invalidFrame", "frame.plane_offset is 2 x 3, should be 3 x 2"),
    ("g.position(2, 2) = -Inf; s.publish(g);", "invalidFrame", r"frame.position\(2, 2\) is -Inf"),
    ("g.plane_normal(:, 1, 2) = [0; 2; 0]; s.publish(g);", "invalidFrame",
     r"unit length: frame.plane_normal\(:, 1, 2\) has length 2"),
    ("g.plane_normal(3, 1, 2) = NaN; s.publish(g);", "invalidFrame", r"frame.plane_normal\(3, 1, 2\) is NaN"),
    ("g.compliance = zeros(2, 3); s.publish(g);", "invalidFrame", "frame.compliance .* square"),
    ("g.compliance = zeros(193); s.publish(g);", "invalidFrame", "frame.compliance .* 192"),
    ("g.compliance = eye(5); s.publish(g);", "invalidFrame", "compliance_rows"),
    ("s.states();", "wrongKind", "'observe'"),
    ("s.frames();", "wrongKind", "'observe'"),
    ("watching.read();", "wrongKind", "Haptic.name."),
    ("watching.publish(g);", "wrongKind", "Haptic.name."),
    ("haptic_mex('read');", "invalidArgument", "Haptic.m"),
    ("haptic_mex('read', 1);", "closed", "Haptic.name."),
    ("haptic_mex('open', uint64(0), 'x');", "invalidArgument", "Haptic.m"),
    ("haptic_mex(0);", "invalidArgument", "Haptic.m"),
]

# How a session that is open as `s` ends.
ENDINGS = [
    "s.close();",
    "s.close(); s.close();",
    "delete(s);",
    "clear s",
    "s = 1;",
    "clear all",
    "clear classes",
    "clear haptic_mex",
    "t = s; c = struct('a', {{t}}); clear s t; c = 0;",
    "clear s; function fails(name), s = Haptic(name); error('x:y', 'z'); end; try, fails(name); catch, end;",
]


class Octave:
    """An interpreter that runs statements one after another."""

    def __init__(self, library: Path, *paths: Path):
        path = [argument for folder in paths for argument in ("--path", str(folder))]
        self.process = subprocess.Popen(["octave-cli", "--no-gui", "--norc", "--quiet", *path], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                        env={**os.environ, "LD_LIBRARY_PATH": str(library)})

    def __enter__(self) -> "Octave":
        return self

    def __exit__(self, *_) -> None:
        self.process.stdin.close()
        said = self.process.stdout.read()
        expect(f"Octave's status, which said \"{said}\"", self.process.wait(60), 0)

    def run(self, statements: str) -> list[str]:
        """Lines that they print; an error is one, `IDENTIFIER: MESSAGE`."""
        text = statements.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")
        self.process.stdin.write(f"try, eval(\"{text}\"); catch e, printf('%s: %s\\n', e.identifier, e.message); end\n"
                                 "clear e; printf('\\nend of it\\n');\n")
        self.process.stdin.flush()
        lines = []
        for line in self.process.stdout:
            if line == "end of it\n":
                return [line for line in lines if line]
            lines.append(line.rstrip("\n"))
        sys.exit(f"error: Octave has ended in {statements}:\n" + "\n".join(lines))

    def quietly(self, statements: str) -> None:
        expect(f"the output of {statements}", self.run(statements), [])


def compile_gateway(prefix: Path, library: Path, to: Path, headers: Path | None = None) -> None:
    to.mkdir(parents=True, exist_ok=True)
    include = f"{headers}:{prefix / 'include'}" if headers else str(prefix / "include")
    subprocess.run(["mkoctfile", "--mex", "haptic_mex.c", "-lhaptic", "-o", str(to / "haptic_mex.mex")], cwd=EXAMPLE, check=True,
                   env={**os.environ, "C_INCLUDE_PATH": include, "LIBRARY_PATH": str(library), "CFLAGS": f"-O2 -fPIC {STRICT}"})


def check_loading(prefix: Path, library: Path, work: Path) -> None:
    """What is said if the gateway, libhaptic, or one of the same ABI is not there."""
    broken, other = work / "broken", work / "other-abi"
    broken.mkdir(exist_ok=True)
    (broken / "libhaptic.so.0").write_text("")
    header = (prefix / "include/haptic/frames.h").read_text()
    (other / "haptic").mkdir(parents=True, exist_ok=True)
    (other / "haptic/frames.h").write_text(re.sub(r"(HAPTIC_ABI_VERSION) \d+u", r"\1 4000u", header))
    (other / "haptic/haptic.h").write_text((prefix / "include/haptic/haptic.h").read_text())
    compile_gateway(prefix, library, other, other)
    for folder, gateway, pattern in ((library, work / "broken", "haptic_mex.* undefined.*Compile haptic_mex.c"),
                                     (broken, work, "libhaptic.so.0.*install libhaptic0"),
                                     (library, other, r"ABI \d+, and haptic_mex was compiled for 4000: compile it again")):
        with Octave(folder, EXAMPLE, gateway) as octave:
            for statement in ("Haptic('x');", "Haptic('x', 'observe');"):
                said = " ".join(octave.run(statement))
                if not re.match(f"haptic:notLoaded: .*{pattern}", said):
                    sys.exit(f"error: {statement} says \"{said}\", should name {pattern}")


def check_frame(frame: ContactFrame) -> None:
    expect("the frame's head", [frame.state_sequence, frame.state_time_ns, frame.plane_time_ns, frame.step_ns, frame.stiffness,
                                frame.torque_stiffness, frame.static_friction, frame.dynamic_friction, frame.body_work,
                                frame.flags, frame.proxy_count, frame.compliance_rows],
           [2**64 - 12, 2**63 - 13, -13, 14, 15, 16, 18, 17, 19, 9, 64, 192])
    for i, proxy in enumerate(frame.proxies):
        first = [*proxy.rest_offset, *proxy.position, *proxy.rest_velocity, *proxy.surface_velocity]
        expect(f"proxy {i}", first, [100.0 * i + k for k in range(12)])
        expect(f"radius of proxy {i}", proxy.radius, 0.125 * i + 0.0625)
        expect(f"counts of proxy {i}", (proxy.in_contact, proxy.plane_count), (2 if i else 1, 3))
        for p, plane in enumerate(proxy.planes):
            expect(f"plane {p} of proxy {i}", (list(plane.normal), plane.offset, plane.velocity),
                   ([[1, 0, 0], [0, 0, -1], [0, 1, 0]][p], 100.0 * i + 12 + 2 * p, 100.0 * i + 13 + 2 * p))
    rows = [2.0 * (r == s) + (r + 1) * (s + 1) / 192**2 for r in range(192) for s in range(r + 1)]
    expect("the compliance", list(frame.compliance), [ctypes.c_float(value).value for value in rows])


def check_writing(octave: Octave, haptic: ctypes.CDLL, session: str) -> None:
    """What Haptic.m publishes, seen by libhaptic and by an observer of its own."""
    observer = haptic.haptic_contact_observer_open(session.encode())
    octave.quietly(f"watching = Haptic('{session}', 'observe'); none = watching.frames(); x = [none.plane_normal];")
    expect("the sequence", octave.run(FRAME + "n = s.publish(f); printf('%d %s', n, class(n));"), ["1 uint64"])
    octave.quietly("lower = f; lower.compliance = tril(f.compliance); s.publish(lower);")
    frame = ContactFrame()
    for sequence in (1, 2):
        found = haptic.haptic_contact_observer_next(observer, frame, haptic.haptic_now_ns())
        expect("the number of frames", (found, frame.sequence), (1, sequence))
        check_frame(frame)
    octave.quietly("""
        seen = watching.frames();
        names = fieldnames(f);
        for k = 1:numel(names)
            x = seen(2).(names{k});
            if ~isequal(single(x), single(f.(names{k}))) || ~isequal(size(x), size(f.(names{k})))
                disp(names{k});
            end
        end
        s.publish(seen(1));""")
    expect("the number of frames published again",
           (haptic.haptic_contact_observer_next(observer, frame, haptic.haptic_now_ns()), frame.sequence), (1, 3))
    check_frame(frame)
    # The smallest: no proxy, and one whose planes do not count.
    octave.quietly("for n = 0:1, g = Haptic.frame(n); g.step_ns = 1; g.plane_offset(:, :) = NaN; s.publish(g); end;")
    for proxies in (0, 1):
        expect("a small frame", (haptic.haptic_contact_observer_next(observer, frame, haptic.haptic_now_ns()),
                                 frame.proxy_count, frame.compliance_rows), (1, proxies, 0))
    shapes = octave.run("seen = watching.frames(); for k = 2:3, disp([size(seen(k).position), size(seen(k).compliance)]), "
                        "disp(size(seen(k).plane_normal)), end;")
    expect("the shapes observed", [line.split() for line in shapes],
           [["3", "0", "0", "0"], ["3", "3", "0"], ["3", "1", "0", "0"], ["3", "3"]])
    haptic.haptic_contact_observer_close(observer)


def numbered_state() -> DeviceState:
    """Every number differs from the others, and an integer is more than a double, or than an int32, can hold."""
    state = DeviceState()
    number = 0
    for name, kind in DeviceState._fields_:
        number += 10
        if hasattr(kind, "_length_"):
            setattr(state, name, kind(*(number + k + 0.1 for k in range(kind._length_))))
        elif kind is ctypes.c_double:
            setattr(state, name, number + 0.1)
        else:
            setattr(state, name, {8: 2**62, 4: 2**31}[ctypes.sizeof(kind)] + number)
    state.safety_state = 3
    return state


def lines_of(state: DeviceState) -> list[str]:
    """A state as SHOW prints it."""
    names = {ctypes.c_uint64: "uint64", ctypes.c_int64: "int64", ctypes.c_uint32: "uint32", ctypes.c_double: "double"}
    lines = []
    for name, kind in DeviceState._fields_:
        values = list(getattr(state, name)) if hasattr(kind, "_length_") else [getattr(state, name)]
        number = names[kind._type_ if hasattr(kind, "_length_") else kind]
        texts = [f"{value:.17g}" if number == "double" else str(value) for value in values]
        lines.append(f"{name} {number} {len(values)}x1 " + " ".join(texts))
    return lines


SHOW = """
names = fieldnames(x);
for k = 1:numel(names)
    value = x.(names{k});
    printf('%s %s %dx%d', names{k}, class(value), size(value, 1), size(value, 2));
    if isa(value, 'double'), printf(' %.17g', value); else, printf(' %s', strtrim(disp(value))); end;
    printf('\\n');
end;
"""


def check_reading(octave: Octave, haptic: ctypes.CDLL, session: str, state_writer: Path) -> None:
    """What Haptic.m reads of a state that has every number."""
    observer = haptic.haptic_state_observer_open(session.encode())
    octave.quietly("if ~isempty(s.read()), disp('a state?'); end; x = watching.states(); x = [x.force];")
    with subprocess.Popen([state_writer, session], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        process.stdin.write(bytes(numbered_state()))
        process.stdin.flush()
        expect("the answer of state_writer", process.stdout.readline(), b"published\n")
        state = DeviceState()
        expect("the number of states", haptic.haptic_state_observer_next(observer, state, haptic.haptic_now_ns()), 1)
        for statement in ("x = s.wait(5);", "x = watching.states();"):
            expect(f"the state of {statement}", octave.run(statement + SHOW), lines_of(state))
        peer = octave.run("p = s.peer(); printf('%d %d %s', p.pid, p.closed, strtrim(disp(p.session))); "
                          "printf(' %s', class(p.pid), class(p.heartbeat_ns)); "
                          "if ~(Haptic.now_ns() - p.heartbeat_ns < 60e9 && p.heartbeat_ns > 0), disp('heartbeat'); end;")
        expect("the peer", peer, [f"{process.pid} 0 {state.session} uint32 int64"])
        expect("a second read", octave.run("disp(size(s.read()))"), ["   0   0"])
        octave.quietly("s.beat();")
        process.stdin.close()
    expect("the peer that has left", octave.run("p = s.peer(); printf('%d %d', p.pid, p.closed)"), ["0 1"])
    haptic.haptic_state_observer_close(observer)


def check_names(octave: Octave, header: str) -> None:
    """Constants and names of bits against frames.h; the help text against the structures."""
    constants = re.findall(r"HAPTIC_(?:PROXY_|FRAME_)?([A-Z_]+) = (?:1u << )?(\d+)",
                           header[header.index("HAPTIC_PROXY_TOUCHES = "):header.index("HAPTIC_FAULT_EXCHANGE = ")])
    expect("the number of constants", len(constants), 12)
    for name, value in constants:
        bit = re.search(rf"{name} = 1u", header) is not None
        expect(name, octave.run(f"disp(Haptic.{name})"), [str(1 << int(value) if bit else int(value))])
    for kind, field in (("FAULT", "faults"), ("TICK", "tick_flags")):
        for name, bit in re.findall(rf"HAPTIC_{kind}_([A-Z_]+) = 1u << (\d+)", header):
            found = octave.run("x = struct('safety_state', uint32(5), 'faults', uint32(0), 'tick_flags', uint32(0)); "
                               f"x.{field} = uint32(2^{bit}); x = Haptic.describe(x); "
                               "printf('%s\\n', x.safety_state, x.faults{:}, x.tick_flags{:});")
            expect(f"the name of {kind} {name}", found, ["proving", {"JUMP": "encoder_jump"}.get(name, name.lower())])
    text = octave.run("disp(get_help_text('Haptic'))")
    for name in [name for name, _ in DeviceState._fields_] + octave.run("printf('%s\\n', fieldnames(Haptic.frame(1)){:})"):
        if not any(re.search(rf"\b{name}\b", line) for line in text):
            sys.exit(f"error: help Haptic does not name {name}")


def check_errors(octave: Octave) -> None:
    for statement, identifier, pattern in ERRORS:
        said = octave.run("g = Haptic.frame(2); g.step_ns = 1; g.plane_count(2) = 1; g.plane_normal(:, 1, 2) = [0 1 0]; "
                          + statement)
        if len(said) != 1 or not re.match(f"haptic:{identifier}: .*({pattern})", said[0]):
            sys.exit(f"error: {statement} says {said}, should say haptic:{identifier} and name {pattern}")
    # None of them has published anything, or closed the session.
    octave.quietly("for k = 1:numel(watching.frames()), disp('published'); end; s.beat();")


def is_free(haptic: ctypes.CDLL, session: str) -> bool:
    """Whether both roles of a simulation can be taken."""
    states = haptic.haptic_state_reader_open(session.encode())
    contacts = haptic.haptic_contact_writer_open(session.encode())
    haptic.haptic_state_reader_close(states)
    haptic.haptic_contact_writer_close(contacts)
    return bool(states and contacts)


def check_two_simulations(octave: Octave, haptic: ctypes.CDLL, session: str) -> None:
    contacts = haptic.haptic_contact_writer_open(session.encode())
    said = " ".join(octave.run(f"Haptic('{session}');"))
    if not re.match(rf"haptic:notOpened: .*{session}.*{os.getpid()}", said):
        sys.exit(f"error: a second simulation is told \"{said}\"")
    haptic.haptic_contact_writer_close(contacts)
    expect("the session after a refusal is free", is_free(haptic, session), True)
    said = " ".join(octave.run(f"s = Haptic('{session}'); t = Haptic('{session}');"))
    if not said.startswith("haptic:notOpened: "):
        sys.exit(f"error: a second simulation of the same program is told \"{said}\"")
    octave.quietly("s.beat(); clear s")


def check_endings(octave: Octave, haptic: ctypes.CDLL, session: str) -> None:
    for ending in ENDINGS:
        octave.quietly(f"s = Haptic('{session}');")
        expect(f"the session before {ending} is free", is_free(haptic, session), False)
        octave.quietly(f"name = '{session}'; {ending}")
        expect(f"the session after {ending} is free", is_free(haptic, session), True)
    # A handle of before never becomes one of another session.
    octave.quietly(f"s = Haptic('{session}'); clear haptic_mex; t = Haptic('{session}');")
    expect("what is closed says", octave.run("s.read();")[0].split(":")[:2], ["haptic", "closed"])
    octave.quietly("clear s; t.beat(); clear t")
    said = octave.run(f"for k = 1:40, all{{k}} = Haptic('{session}', 'observe'); end;")
    if not re.match("haptic:notOpened: .*close some", said[0]):
        sys.exit(f"error: many observers are told {said}")
    octave.quietly(f"clear all; Haptic('{session}', 'observe').close();")


def check_exits(session: str, library: Path, work: Path) -> None:
    """The interpreter ends with a session that is open."""
    for statements, status in (("", 0), ("error('x:y', 'z')", 1), ("exit(3)", 3)):
        done = subprocess.run(["octave-cli", "--no-gui", "--norc", "--path", EXAMPLE, "--path", work, "--eval",
                               f"s = Haptic('{session}'); s.beat(); {statements}"], capture_output=True, text=True,
                              env={**os.environ, "LD_LIBRARY_PATH": str(library)})
        expect(f"Octave's status after {statements}", done.returncode, status)
        expect("segments that are left", [path.name for path in Path("/dev/shm").glob(f"haptic-*-{session}-*")], [])


def wait_for_segments(session: str, count: int) -> None:
    end = time.monotonic() + 20
    while len(list(Path("/dev/shm").glob(f"haptic-*-{session}-*"))) != count:
        if time.monotonic() > end:
            sys.exit(f"error: at Ctrl-C the session does not get to {count} segments")
        time.sleep(2e-4)


def check_interrupts(session: str, library: Path, work: Path) -> None:
    """Ctrl-C ends the function that has the session, and not the interpreter; also while it opens the session. In new
    interpreters, which are slow there: an id that the call that opens returned was lost in half of them."""
    for pause in [0.0] * 8 + [0.1]:
        with subprocess.Popen(["octave-cli", "--no-gui", "--norc", "--quiet", "--interactive", "--path", EXAMPLE, "--path", work],
                              stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                              env={**os.environ, "LD_LIBRARY_PATH": str(library)}) as octave:
            octave.stdin.write(f"function feel(), s = Haptic('{session}'); while true, s.beat(); pause(0.001); end; end\nfeel()\n")
            octave.stdin.flush()
            wait_for_segments(session, 2)
            time.sleep(pause)
            octave.send_signal(signal.SIGINT)
            wait_for_segments(session, 0)
            said, _ = octave.communicate("disp('it goes on')\n", timeout=60)
            expect("what Octave does after Ctrl-C", "it goes on" in said, True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--prefix", type=Path, required=True)
    parser.add_argument("--state-writer", type=Path, required=True)
    parser.add_argument("--work", type=Path, required=True)
    options = parser.parse_args()
    prefix, work = options.prefix.resolve(), options.work.resolve()
    library = find_library(prefix)
    compile_gateway(prefix, library.parent, work)
    check_loading(prefix, library.parent, work)

    haptic = load(library)
    session = f"matlab-{os.getpid()}"
    with Octave(library.parent, EXAMPLE, work) as octave:
        octave.quietly(f"s = Haptic('{session}');")
        check_writing(octave, haptic, session)
        check_reading(octave, haptic, session, options.state_writer)
        check_names(octave, (prefix / "include/haptic/frames.h").read_text())
        check_errors(octave)
        octave.quietly("clear all")
        check_two_simulations(octave, haptic, session)
        check_endings(octave, haptic, session)
    check_exits(session, library.parent, work)
    check_interrupts(session, library.parent, work)


if __name__ == "__main__":
    main()
