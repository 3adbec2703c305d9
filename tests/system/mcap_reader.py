"""Reads MCAP files and messages of ROS 2 in CDR, from the specifications alone, and checks everything that they promise.

MCAP: https://mcap.dev/spec (magic, records, checksums, chunks, their indices and the summary). CDR: OMG's DDS-XTypes, the plain
encoding of version 1. zstd unpacks the chunks.
"""
import re
import struct
import subprocess
import zlib
from dataclasses import dataclass, field

MAGIC = b"\x89MCAP0\r\n"
(HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA,
 METADATA_INDEX, SUMMARY_OFFSET, DATA_END) = range(1, 16)


class Invalid(Exception):
    pass


def require(holds: bool, *what) -> None:
    if not holds:
        raise Invalid(" ".join(map(str, what)))


class Fields:
    """The fields of a record, one after the other."""

    def __init__(self, data: bytes):
        self.data, self.at = data, 0

    def number(self, code: str) -> int:
        value, = struct.unpack_from("<" + code, self.data, self.at)
        self.at += struct.calcsize("<" + code)
        return value

    def numbers(self, codes: str) -> tuple:
        return tuple(self.number(code) for code in codes)

    def bytes(self, length: int) -> bytes:
        require(self.at + length <= len(self.data), "a field ends beyond its record")
        self.at += length
        return self.data[self.at - length:self.at]

    def text(self) -> str:
        return self.bytes(self.number("I")).decode()

    def pairs(self, read_key, read_value) -> list[tuple]:
        length = self.number("I")
        end, pairs = self.at + length, []
        while self.at < end:
            pairs.append((read_key(self), read_value(self)))
        require(self.at == end, "an array is not as long as it says")
        return pairs

    def text_map(self) -> dict[str, str]:
        pairs = self.pairs(Fields.text, Fields.text)
        require(len(dict(pairs)) == len(pairs), "a key stands twice")
        return dict(pairs)

    def rest(self) -> bytes:
        return self.bytes(len(self.data) - self.at)


def records_of(data: bytes, at: int, end: int):
    """Each record as (offset, length with its head, opcode, content)."""
    while at < end:
        require(at + 9 <= end, "a record's head is cut off")
        opcode, length = struct.unpack_from("<BQ", data, at)
        require(at + 9 + length <= end, "a record is cut off")
        yield at, 9 + length, opcode, data[at + 9:at + 9 + length]
        at += 9 + length


@dataclass(frozen=True)
class Schema:
    id: int
    name: str
    encoding: str
    data: bytes


@dataclass
class Channel:
    id: int
    schema: int
    topic: str
    encoding: str
    metadata: dict[str, str]


@dataclass
class Message:
    channel: int
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


@dataclass
class Mcap:
    profile: str = ""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    messages: list[Message] = field(default_factory=list)
    attachments: dict[str, bytes] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    chunks: int = 0
    largest_chunk: int = 0

    def of_topic(self, topic: str) -> list[Message]:
        channel, = (c.id for c in self.channels.values() if c.topic == topic)
        return [message for message in self.messages if message.channel == channel]

    def schema_of(self, topic: str) -> Schema:
        channel, = (c for c in self.channels.values() if c.topic == topic)
        return self.schemas[channel.schema]


def add(table: dict, record) -> None:
    require(table.setdefault(record.id, record) == record, "an id stands for two things:", record)


def read_shared(mcap: Mcap, opcode: int, content: bytes) -> bool:
    """Schemas and channels, which stand in chunks and in the summary."""
    f = Fields(content)
    if opcode == SCHEMA:
        add(mcap.schemas, Schema(f.number("H"), f.text(), f.text(), f.bytes(f.number("I"))))
    elif opcode == CHANNEL:
        channel = Channel(f.number("H"), f.number("H"), f.text(), f.text(), f.text_map())
        require(channel.schema in mcap.schemas, "a channel precedes its schema")
        add(mcap.channels, channel)
    else:
        return False
    return True


@dataclass
class Chunk:
    """What the index must say of it."""
    start: int
    end: int
    offset: int
    length: int
    compression: str
    compressed: int
    uncompressed: int
    messages: dict[int, set[tuple[int, int]]]  # per channel: time and offset in the chunk
    index_offsets: dict[int, int] = field(default_factory=dict)
    index_length: int = 0


def read_chunk(mcap: Mcap, offset: int, length: int, content: bytes) -> Chunk:
    f = Fields(content)
    start, end, size, checksum = f.numbers("QQQI")
    compression = f.text()
    packed = f.bytes(f.number("Q"))
    require(compression == "zstd", "chunks are packed by", compression)
    data = subprocess.run(["zstd", "-dcq"], input=packed, capture_output=True, check=True).stdout
    require(len(data) == size, "a chunk's size")
    require(zlib.crc32(data) == checksum, "a chunk's checksum")
    mcap.chunks += 1
    mcap.largest_chunk = max(mcap.largest_chunk, size)
    chunk = Chunk(start, end, offset, length, compression, len(packed), size, {})
    for at, _, opcode, inner in records_of(data, 0, len(data)):
        if read_shared(mcap, opcode, inner):
            continue
        require(opcode == MESSAGE, "record", opcode, "in a chunk")
        m = Fields(inner)
        message = Message(*m.numbers("HIQQ"), m.rest())
        require(message.channel in mcap.channels, "a message precedes its channel")
        require(start <= message.log_time <= end, "a message is outside its chunk's times")
        mcap.messages.append(message)
        chunk.messages.setdefault(message.channel, set()).add((message.log_time, at))
    times = [time for entries in chunk.messages.values() for time, _ in entries]
    require((min(times), max(times)) == (start, end), "a chunk's times")
    return chunk


def read_message_index(chunk: Chunk, offset: int, length: int, content: bytes) -> None:
    f = Fields(content)
    channel = f.number("H")
    entries = f.pairs(lambda g: g.number("Q"), lambda g: g.number("Q"))
    require(len(entries) == len(set(entries)) and set(entries) == chunk.messages.get(channel), "the index of channel", channel)
    chunk.index_offsets[channel] = offset
    chunk.index_length += length


def read_attachment(mcap: Mcap, content: bytes) -> tuple:
    f = Fields(content)
    log_time, create_time = f.numbers("QQ")
    name, media_type = f.text(), f.text()
    data = f.bytes(f.number("Q"))
    require(zlib.crc32(content[:f.at]) == f.number("I"), "an attachment's checksum")
    mcap.attachments[name] = data
    return log_time, create_time, len(data), name, media_type


def read_metadata(mcap: Mcap, content: bytes) -> str:
    f = Fields(content)
    name = f.text()
    require(name not in mcap.metadata, "two records of metadata are named", name)
    mcap.metadata[name] = f.text_map()
    return name


def check_statistics(mcap: Mcap, content: bytes) -> None:
    f = Fields(content)
    counts = f.numbers("QHIIII")
    require(counts == (len(mcap.messages), len(mcap.schemas), len(mcap.channels), len(mcap.attachments), len(mcap.metadata), mcap.chunks),
            "statistics", counts)
    times = [message.log_time for message in mcap.messages]
    require(f.numbers("QQ") == (min(times), max(times)), "the times of the statistics")
    per_channel = dict(f.pairs(lambda g: g.number("H"), lambda g: g.number("Q")))
    expected: dict[int, int] = {}
    for message in mcap.messages:
        expected[message.channel] = expected.get(message.channel, 0) + 1
    require(per_channel == expected, "messages of each channel", per_channel)


def check_summary(mcap: Mcap, data: bytes, start: int, end: int, chunks: list[Chunk], attachments: dict, metadata: dict) -> None:
    repeated = Mcap()
    groups: dict[int, list[int]] = {}  # begin and length
    indexed: dict[int, int] = {}
    for offset, length, opcode, content in records_of(data, start, end):
        group = groups.setdefault(opcode, [offset, 0])
        require(group[0] + group[1] == offset, "records of one kind stand apart")
        group[1] += length
        indexed[opcode] = indexed.get(opcode, 0) + 1
        f = Fields(content)
        if read_shared(repeated, opcode, content):
            continue
        if opcode == STATISTICS:
            check_statistics(mcap, content)
        elif opcode == CHUNK_INDEX:
            chunk = next(c for c in chunks if c.offset == struct.unpack_from("<Q", content, 16)[0])
            require(f.numbers("QQQQ") == (chunk.start, chunk.end, chunk.offset, chunk.length), "a chunk's index")
            require(dict(f.pairs(lambda g: g.number("H"), lambda g: g.number("Q"))) == chunk.index_offsets, "where its messages' are")
            require((f.number("Q"), f.text(), *f.numbers("QQ")) ==
                    (chunk.index_length, chunk.compression, chunk.compressed, chunk.uncompressed), "its sizes")
        elif opcode == ATTACHMENT_INDEX:
            place = f.numbers("QQ")
            require((*f.numbers("QQQ"), f.text(), f.text()) == attachments[place], "an attachment's index")
        elif opcode == METADATA_INDEX:
            place = f.numbers("QQ")
            require(f.text() == metadata[place], "an index of metadata")
        else:
            raise Invalid(f"record {opcode} in the summary")
    require((repeated.schemas, repeated.channels) == (mcap.schemas, mcap.channels), "the summary's schemas and channels")
    found = [indexed.get(opcode, 0) for opcode in (STATISTICS, CHUNK_INDEX, ATTACHMENT_INDEX, METADATA_INDEX)]
    require(found == [1, len(chunks), len(attachments), len(metadata)], "the summary has", found)
    return groups


def read(data: bytes) -> Mcap:
    """A whole file. Throws Invalid if anything in it contradicts the specification or itself."""
    require(data.startswith(MAGIC) and data.endswith(MAGIC), "no MCAP file")
    mcap = Mcap()
    # Footer: 9 bytes of head, three fields.
    footer_at = len(data) - len(MAGIC) - 29
    (_, _, opcode, footer), = records_of(data, footer_at, len(data) - len(MAGIC))
    require(opcode == FOOTER, "no footer")
    summary_at, offsets_at, checksum = struct.unpack("<QQI", footer)
    require(zlib.crc32(data[summary_at:footer_at + 25]) == checksum, "the summary's checksum")
    # Data section.
    chunks: list[Chunk] = []
    attachments, metadata = {}, {}
    ended = False
    for k, (offset, length, opcode, content) in enumerate(records_of(data, len(MAGIC), summary_at)):
        require(not ended and (k == 0) == (opcode == HEADER), "record", opcode, "out of place")
        if opcode == HEADER:
            mcap.profile = Fields(content).text()
        elif opcode == CHUNK:
            chunks.append(read_chunk(mcap, offset, length, content))
        elif opcode == MESSAGE_INDEX:
            read_message_index(chunks[-1], offset, length, content)
        elif opcode == ATTACHMENT:
            attachments[offset, length] = read_attachment(mcap, content)
        elif opcode == METADATA:
            metadata[offset, length] = read_metadata(mcap, content)
        elif opcode == DATA_END:
            require(zlib.crc32(data[:offset]) == struct.unpack("<I", content)[0], "the data section's checksum")
            ended = True
        else:
            raise Invalid(f"record {opcode} among the data")
    require(ended, "the data section has no end")
    for chunk in chunks:
        require(set(chunk.index_offsets) == set(chunk.messages), "each channel of a chunk is indexed")
    # Summary, and where its groups are.
    groups = check_summary(mcap, data, summary_at, offsets_at, chunks, attachments, metadata)
    told = {}
    for _, _, opcode, content in records_of(data, offsets_at, footer_at):
        require(opcode == SUMMARY_OFFSET, "record", opcode, "among the summary's offsets")
        group, begin, size = Fields(content).numbers("BQQ")
        told[group] = [begin, size]
    require(told == groups, "the summary's offsets", told, groups)
    return mcap


PRIMITIVES = {"float64": "d", "float32": "f", "int64": "q", "uint64": "Q", "int32": "i", "uint32": "I"}


class Type:
    """A message's type from its ros2msg text: fields, and the types that it names."""

    def __init__(self, text: str):
        main, *others = re.split(r"^={80}\nMSG: ", text, flags=re.MULTILINE)
        self.named = {name: self.fields_of(body) for name, _, body in (other.partition("\n") for other in others)}
        self.fields = self.fields_of(main)
        self.units = dict(re.findall(r"^\w+ (\w+)  # (.+)$", main, re.MULTILINE))

    @staticmethod
    def fields_of(body: str) -> list[tuple[str, str]]:
        return [tuple(line.split("#")[0].split()) for line in body.splitlines()]

    def decode(self, data: bytes) -> dict:
        require(data[:4] == b"\x00\x01\x00\x00", "not plain CDR, little-endian")
        self.data, self.at = data[4:], 0
        value = self.value_of(self.fields)
        require(self.at == len(self.data), "bytes are left over")
        return value

    def value_of(self, fields: list[tuple[str, str]]) -> dict:
        return {name: self.one(kind) for kind, name in fields}

    def primitive(self, code: str):
        size = struct.calcsize(code)
        self.at += -self.at % size
        value, = struct.unpack_from("<" + code, self.data, self.at)
        self.at += size
        return value

    def one(self, kind: str):
        if kind.endswith("[]"):
            return [self.one(kind[:-2]) for _ in range(self.primitive("I"))]
        if kind == "string":
            length = self.primitive("I")
            self.at += length
            text = self.data[self.at - length:self.at]
            require(text.endswith(b"\0"), "a string has no end")
            return text[:-1].decode()
        if kind in PRIMITIVES:
            return self.primitive(PRIMITIVES[kind])
        fields, = (f for name, f in self.named.items() if name == kind or name.endswith("/" + kind))
        return self.value_of(fields)
