#!/usr/bin/env python3
"""A USB/IP client that shares nothing with the server but the published protocol: usbip_client.py HOST PORT

Written from the Linux kernel's documentation (usb/usbip_protocol), chapter 9 of the USB 2.0 specification, and the
published facts of the Spidar-G6 X3R and its SH4 board. It expects a served X3R whose hand follows the recording that
`usbip_client.py --hand` prints, imports it, and checks:

  descriptors   0cec:0205, high speed, bulk OUT 0x02 and bulk IN 0x86 of 512 bytes
  packets       one reply of 512 bytes for each command, which echoes its DAC codes
  counters      those of a grip at the centre, then of one place on the straight way that the hand takes, then of its end
  protocol      a second client is told that the device is busy; a waiting transfer can be taken back

Exit status 0 if all of it holds.
"""
import math
import socket
import struct
import sys
import time

# The way of the hand: from the centre to END, in the device's frame: metres, x right, y up, z toward the person.
MOVE_S = 0.5
END = (0.012, -0.008, 0.010)
ANGLE = math.radians(20.0)
AXIS = (1 / 3, 2 / 3, 2 / 3)

# Spidar-G6 X3R as published: full sizes of frame and grip, m, the whole list turned by -45 degrees about y, z away from
# the person. Motors are at the corners, each a knot of the grip.
HALF = (0.060, 0.076, 0.060)
GRIP = 0.0225
CORNERS = [(-1, -1, +1), (+1, -1, +1), (+1, -1, -1), (-1, -1, -1), (-1, +1, +1), (+1, +1, +1), (+1, +1, -1), (-1, +1, -1)]
KNOTS = [(-1, 0, 0), (+1, 0, 0), (0, -1, 0), (0, -1, 0), (-1, 0, 0), (+1, 0, 0), (0, +1, 0), (0, +1, 0)]
SIGNS = [+1, +1, -1, -1, -1, -1, +1, +1]  # the raw counter falls where this is +, when the string pays out
METRES_PER_COUNT = 1.66555e-5
MINIMUM_CODE = 45  # 0.3 N: trunc(0.3 * 0.365296803653 V/N * 415 codes/V)

IN, OUT = 1, 0


def rotated(p):
    c = math.sqrt(0.5)
    return (c * (p[0] - p[2]), p[1], c * (p[0] + p[2]))


MOTORS = [rotated([s * h for s, h in zip(corner, HALF)]) for corner in CORNERS]
POINTS = [rotated([k * GRIP for k in knot]) for knot in KNOTS]


def rotate(axis, angle, p):
    """Rodrigues."""
    c, s = math.cos(angle), math.sin(angle)
    dot = sum(a * b for a, b in zip(axis, p))
    cross = (axis[1] * p[2] - axis[2] * p[1], axis[2] * p[0] - axis[0] * p[2], axis[0] * p[1] - axis[1] * p[0])
    return [c * p[i] + s * cross[i] + (1 - c) * dot * axis[i] for i in range(3)]


def counts_at(way):
    """Counts by which each string is longer than at the centre, a fraction of the way along; not rounded."""
    place = (END[0] * way, END[1] * way, -END[2] * way)  # z the other way round in the published frame,
    axis = (-AXIS[0], -AXIS[1], AXIS[2])  # and so the sense of rotation about x and y
    counts = []
    for motor, point in zip(MOTORS, POINTS):
        moved = rotate(axis, ANGLE * way, point)
        length = math.dist(motor, [place[i] + moved[i] for i in range(3)])
        counts.append((length - math.dist(motor, point)) / METRES_PER_COUNT)
    return counts


def paid_out(raw, raw_at_centre):
    """Counts by which each string is longer, from 16-bit counters that wrap."""
    return [-s * (((r - r0 + 32768) & 0xFFFF) - 32768) for s, r, r0 in zip(SIGNS, raw, raw_at_centre)]


def print_hand():
    """The same way as a recording; 51 rows, because a recording is interpolated between them."""
    print("time_s,x_m,y_m,z_m,qw,qx,qy,qz")
    for i in range(51):
        way = i / 50
        half = 0.5 * ANGLE * way
        row = [MOVE_S * way] + [way * e for e in END] + [math.cos(half)] + [a * math.sin(half) for a in AXIS]
        print(",".join("%.12f" % value for value in row))


def check(holds, claim):
    if not holds:
        sys.exit("usbip_client: does not hold: " + claim)


class Connection:
    def __init__(self, host, port):
        self.socket = socket.create_connection((host, port), timeout=10)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.sequence = 0
        self.device = 0

    def receive(self, count):
        data = b""
        while len(data) < count:
            try:
                piece = self.socket.recv(count - len(data))
            except ConnectionError:
                piece = b""
            check(piece, "the server keeps the connection (%d of %d bytes came)" % (len(data), count))
            data += piece
        return data

    def list(self):
        self.socket.sendall(struct.pack(">HHI", 0x0111, 0x8005, 0))
        version, code, status, count = struct.unpack(">HHII", self.receive(12))
        check((version, code, status) == (0x0111, 5, 0), "the list has the protocol's header")
        devices = []
        for _ in range(count):
            record = self.receive(312)
            devices.append(record)
            self.receive(4 * record[-1])
        return devices

    def import_device(self, bus_id):
        self.socket.sendall(struct.pack(">HHI32s", 0x0111, 0x8003, 0, bus_id.encode()))
        version, code, status = struct.unpack(">HHI", self.receive(8))
        check((version, code) == (0x0111, 3), "the import has the protocol's header")
        if status == 0:
            bus, address, speed = struct.unpack(">III", self.receive(312)[288:300])
            check(speed == 3, "the device is of high speed")
            self.device = bus << 16 | address
        return status

    def submit(self, direction, endpoint, length, data=b"", setup=bytes(8)):
        self.sequence += 1
        header = struct.pack(">IIIII IIIII 8s", 1, self.sequence, self.device, direction, endpoint, 0, length, 0, 0, 0, setup)
        try:
            self.socket.sendall(header + data)
        except ConnectionError:
            pass  # the caller that waits for the answer notices
        return self.sequence

    def unlink(self, target):
        self.sequence += 1
        self.socket.sendall(struct.pack(">IIIII I 24s", 2, self.sequence, self.device, 0, 0, target, bytes(24)))
        return self.sequence

    def answer(self, has_data=()):
        """Command, sequence, status, length and data of the next answer."""
        command, sequence, _, _, _, status, length = struct.unpack(">IIIII iI", self.receive(28))
        self.receive(20)
        data = self.receive(length) if command == 3 and sequence in has_data else b""
        return command, sequence, status, length, data

    def control_in(self, request_type, request, value, index, length):
        setup = struct.pack("<BBHHH", request_type, request, value, index, length)
        sequence = self.submit(IN, 0, length, setup=setup)
        command, answered, status, _, data = self.answer({sequence})
        check((command, answered, status) == (3, sequence, 0), "a control request is answered")
        return data

    def exchange(self, dac_codes):
        """One cycle of an SH4 board: DAC codes out, raw counters in."""
        wanted = self.submit(IN, 6, 512)
        sent = self.submit(OUT, 2, 512, b"\x01\x0e" + struct.pack("<8H", *dac_codes) + bytes(494))
        answers = {}
        for _ in range(2):
            command, sequence, status, length, data = self.answer({wanted})
            check((command, status, length) == (3, 0, 512), "each transfer of a cycle is whole")
            answers[sequence] = data
        check(set(answers) == {wanted, sent}, "each transfer of a cycle is answered once")
        reply = answers[wanted]
        check(len(reply) == 512, "a reply has 512 bytes")
        check(struct.unpack("<8H", reply[:16]) == tuple(dac_codes), "the reply echoes the DAC codes that were sent")
        return struct.unpack("<8H", reply[16:32])


def check_descriptors(client):
    device = client.control_in(0x80, 6, 0x0100, 0, 18)
    check(device[:2] == b"\x12\x01" and device[2:4] == b"\x00\x02", "the device descriptor is that of USB 2.0")
    check(struct.unpack("<HH", device[8:12]) == (0x0CEC, 0x0205), "the device is 0cec:0205")
    configuration = client.control_in(0x80, 6, 0x0200, 0, 255)
    check(len(configuration) == struct.unpack("<H", configuration[2:4])[0], "the configuration is as long as it says")
    endpoints = {}
    at = 0
    while at < len(configuration):
        length, kind = configuration[at], configuration[at + 1]
        if kind == 5:
            address, attributes, size = struct.unpack("<BBH", configuration[at + 2 : at + 6])
            endpoints[address] = (attributes & 3, size)
        at += length
    check(endpoints == {0x02: (2, 512), 0x86: (2, 512)}, "bulk OUT 0x02 and bulk IN 0x86 of 512 bytes, no others")
    check(client.control_in(0x80, 0x00, 0, 0, 2) in (b"\x00\x00", b"\x01\x00"), "the device tells its status")


def check_counters(client):
    dac_codes = [MINIMUM_CODE] * 8
    client.exchange([0] * 8)
    time.sleep(0.6)  # a hand that an earlier client has set in motion goes back now
    at_centre = client.exchange([0] * 8)
    check(paid_out(client.exchange(dac_codes), at_centre) == [0] * 8, "the grip rests at the centre while the hand waits")
    end = [math.floor(count + 0.5) for count in counts_at(1.0)]
    at_end = 0
    between = 0
    replies = 0
    deadline = time.monotonic() + 20
    while at_end < 200:
        check(time.monotonic() < deadline, "the hand arrives; its counts are %s, not %s" % (paid_out(raw, at_centre) if replies else [], end))
        time.sleep(0.001)
        raw = client.exchange(dac_codes)
        replies += 1
        counts = paid_out(raw, at_centre)
        # Where on its way is the hand? By the string that changes most; all others must agree to a count of rounding
        # each way, and to what the recording's rows leave out between them.
        longest = max(range(8), key=lambda i: abs(end[i]))
        low, high = 0.0, 1.0
        for _ in range(40):
            middle = 0.5 * (low + high)
            if abs(counts_at(middle)[longest]) < abs(counts[longest]):
                low = middle
            else:
                high = middle
        expected = counts_at(low)
        worst = max(abs(expected[i] - counts[i]) for i in range(8))
        check(worst <= 2.0, "counts %s are those of one place on the way (%.1f counts off at %.3f of it)" % (counts, worst, low))
        if counts == end:
            at_end += 1
        elif any(counts):
            between += 1
    check(between >= 20, "the hand is seen on its way (%d times)" % between)
    return replies, end


def main():
    if sys.argv[1:] == ["--hand"]:
        print_hand()
        return
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    host, port = sys.argv[1], int(sys.argv[2])

    devices = Connection(host, port).list()
    check(len(devices) == 1, "one device is listed")
    record = devices[0]
    check(struct.unpack(">HH", record[300:304]) == (0x0CEC, 0x0205), "0cec:0205 is listed")
    bus_id = record[256:288].rstrip(b"\0").decode()

    client = Connection(host, port)
    check(client.import_device(bus_id) == 0, "the device can be imported")
    check(Connection(host, port).import_device(bus_id) == 2, "a second client is told that it is busy")
    check_descriptors(client)

    waiting = client.submit(IN, 6, 512)
    taken_back = client.unlink(waiting)
    check(client.answer()[:3] == (4, taken_back, -104), "a waiting transfer can be taken back (ECONNRESET)")

    replies, end = check_counters(client)
    client.exchange([0] * 8)
    print("usbip_client: 0cec:0205 with bulk 0x02 and 0x86, %d replies of 512 bytes, counts at the end %s" % (replies, end))


if __name__ == "__main__":
    main()
