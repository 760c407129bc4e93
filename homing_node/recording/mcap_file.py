# SPDX-License-Identifier: Apache-2.0
"""Writes an MCAP file in blocks.

The `Writer` of the library takes 7 µs for a message, which with two messages a cycle is more than
a record may cost (doc/decisions/0012-records.md). Here the messages of one topic whose length does
not change are packed all at once by NumPy; what is rare is written by the library's own records.

Source of the format: mcap.dev/spec, version 0.
"""

import struct
import zlib
from collections.abc import Iterator, Mapping
from typing import BinaryIO

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import ArrayLike, NDArray

from .template import Template

MAGIC = b'\x89MCAP0\r\n'
#: What stands before the bytes of each message.
HEAD = np.dtype(
    [
        ('opcode', 'u1'),
        ('length', '<u8'),
        ('channel', '<u2'),
        ('sequence', '<u4'),
        ('log_time', '<u8'),
        ('publish_time', '<u8'),
    ]
)
#: The opcode and the length of a record, which its length does not count.
PREFIX = 9
MESSAGE = struct.Struct('<BQHIQQ')
INDEX_HEAD = struct.Struct('<BQHI')
#: The quickest compression: the values of one topic follow each other, and pack well anyhow.
COMPRESSION = 'lz4'

Times = NDArray[np.int64]


class McapFile:
    """An MCAP file that is being written. A chunk is complete in the file after each `flush`."""

    def __init__(self, file: BinaryIO, library: str) -> None:
        """Begin a file.

        Args:
            file: Where it is written; the caller closes it.
            library: Who writes it.

        Raises:
            OSError: It cannot be written.
        """
        self._file, self._at = file, 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._metadata: list[MetadataIndex] = []
        self._chunks: list[ChunkIndex] = []
        self._counts: dict[int, int] = {}
        self._first, self._last = 0, 0  # times of messages in the file, ns
        self._begin_chunk()
        self._write(MAGIC)
        self._record(Header('ros2', library))

    def topic(self, name: str, kind: str, text: str) -> int:
        """Add a topic; return the number of its channel.

        Args:
            name: The name of the topic.
            kind: Its type, `package/msg/Name`.
            text: The definition of the type, in the format ros2msg.
        """
        schema = next((one for one in self._schemas if one.name == kind), None)
        if schema is None:
            schema = Schema(
                id=len(self._schemas) + 1, name=kind, encoding='ros2msg', data=text.encode()
            )
            self._schemas.append(schema)
            self._record(schema)
        number = len(self._channels) + 1
        channel = Channel(
            id=number, topic=name, message_encoding='cdr', schema_id=schema.id, metadata={}
        )
        self._channels.append(channel)
        self._counts[number] = 0
        self._record(channel)
        return number

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add names and values that belong to the file as a whole."""
        at = self._at
        self._record(Metadata(name=name, metadata=dict(values)))
        self._metadata.append(MetadataIndex(offset=at, length=self._at - at, name=name))

    def add(self, channel: int, logged: int, published: int, data: bytes) -> None:
        """Add a message; the times are in ns, the data are CDR."""
        length, number = MESSAGE.size - PREFIX + len(data), self._counts[channel]
        head = MESSAGE.pack(Opcode.MESSAGE, length, channel, number, logged, published)
        self._keep(channel, np.array([[logged, self._size]], np.int64), head + data, 1)

    def add_block(
        self,
        channel: int,
        logged: Times,
        published: Times,
        template: Template,
        columns: Mapping[str, ArrayLike],
        stamped: bool = True,
    ) -> None:
        """Add messages of one topic.

        Args:
            channel: The number of the topic's channel.
            logged: When each was recorded, ns.
            published: The time that each is of, ns.
            template: What a message is.
            columns: The numbers of all messages, by name.
            stamped: Whether the messages have stamps: the times that they are of.
        """
        count, size = len(logged), HEAD.itemsize + template.size
        numbers = np.arange(count)
        block = template.copies(count, HEAD, columns, published if stamped else None)
        block['opcode'] = Opcode.MESSAGE
        block['length'] = size - PREFIX
        block['channel'] = channel
        block['sequence'] = numbers + self._counts[channel]
        block['log_time'], block['publish_time'] = logged, published
        entries = np.empty((count, 2), np.int64)
        entries[:, 0] = logged
        entries[:, 1] = numbers * size + self._size
        self._keep(channel, entries, block.tobytes(), count)

    def flush(self) -> None:
        """Write what was added since the last time as a chunk.

        Raises:
            OSError: It cannot be written.
        """
        if self._parts:
            self._write_chunk()
        self._file.flush()

    def finish(self) -> None:
        """Write the rest and the summary: the file is whole then.

        Raises:
            OSError: It cannot be written.
        """
        self.flush()
        self._record(DataEnd(data_section_crc=0))
        start = self._at
        summary = RecordBuilder()
        offsets: list[SummaryOffset] = []
        for opcode, records in self._summary():
            begin = summary.count
            for record in records:
                record.write(summary)
            if records:
                group = summary.count - begin
                offsets.append(SummaryOffset(opcode, start + begin, group))
        offset_start = start + summary.count
        for offset in offsets:
            offset.write(summary)
        self._write(_bytes_of(summary))
        self._record(Footer(start, offset_start, summary_crc=0))
        self._write(MAGIC)
        self._file.flush()

    # ------------------------------------------------------------------------------------- inside

    def _summary(self) -> Iterator[tuple[Opcode, list[McapRecord]]]:
        """Yield the records of the summary, by kind."""
        counts = {channel: count for channel, count in self._counts.items() if count}
        yield Opcode.SCHEMA, list(self._schemas)
        yield Opcode.CHANNEL, list(self._channels)
        yield (
            Opcode.STATISTICS,
            [
                Statistics(
                    attachment_count=0,
                    channel_count=len(self._channels),
                    channel_message_counts=counts,
                    chunk_count=len(self._chunks),
                    message_count=sum(counts.values()),
                    message_end_time=self._last,
                    message_start_time=self._first,
                    metadata_count=len(self._metadata),
                    schema_count=len(self._schemas),
                )
            ],
        )
        yield Opcode.CHUNK_INDEX, list(self._chunks)
        yield Opcode.METADATA_INDEX, list(self._metadata)

    def _keep(self, channel: int, entries: Times, data: bytes, count: int) -> None:
        """Keep messages for the next chunk, and the time and the place of each for its index."""
        self._index.setdefault(channel, []).append(entries)
        self._parts.append(data)
        self._size += len(data)
        self._counts[channel] += count

    def _begin_chunk(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._index: dict[int, list[Times]] = {}

    def _write_chunk(self) -> None:
        data = b''.join(self._parts)
        found = {channel: np.concatenate(parts) for channel, parts in self._index.items()}
        self._begin_chunk()
        first = min(int(entries[:, 0].min()) for entries in found.values())
        last = max(int(entries[:, 0].max()) for entries in found.values())
        self._first = min(first, self._first or first)
        self._last = max(last, self._last)
        packed = lz4.frame.compress(data)
        begin = self._at
        self._record(
            Chunk(
                compression=COMPRESSION,
                data=packed,
                message_end_time=last,
                message_start_time=first,
                uncompressed_crc=zlib.crc32(data),
                uncompressed_size=len(data),
            )
        )
        length, offsets = self._at - begin, {}
        index_begin = self._at
        for channel, entries in found.items():
            offsets[channel] = self._at
            self._write(_index_record(channel, _in_order(entries)))
        self._chunks.append(
            ChunkIndex(
                chunk_length=length,
                chunk_start_offset=begin,
                compression=COMPRESSION,
                compressed_size=len(packed),
                message_end_time=last,
                message_index_length=self._at - index_begin,
                message_index_offsets=offsets,
                message_start_time=first,
                uncompressed_size=len(data),
            )
        )

    def _record(self, record: McapRecord) -> None:
        builder = RecordBuilder()
        record.write(builder)
        self._write(_bytes_of(builder))

    def _write(self, data: bytes) -> None:
        self._file.write(data)
        self._at += len(data)


def _bytes_of(builder: RecordBuilder) -> bytes:
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data


def _in_order(entries: Times) -> Times:
    """Return the entries of an index in the order of their times; mostly they are already."""
    times = entries[:, 0]
    if (times[1:] >= times[:-1]).all():
        return entries
    return entries[np.argsort(times, kind='stable')]


def _index_record(channel: int, entries: Times) -> bytes:
    """Return the record that tells where the messages of a channel are in a chunk."""
    data = entries.astype('<u8').tobytes()
    length = INDEX_HEAD.size - PREFIX + len(data)
    return INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, length, channel, len(data)) + data
