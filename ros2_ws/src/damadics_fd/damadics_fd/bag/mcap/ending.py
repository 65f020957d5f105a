# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The end of a file that is written: what its summary says, collected on the way."""

import struct
from collections import Counter

from damadics_fd.bag.mcap.crc import crc32
from damadics_fd.bag.mcap.records import (
    CHUNK_INDEX,
    FOOTER,
    HEAD,
    MAGIC,
    STATISTICS,
    Attachment,
    Channel,
    Op,
    Schema,
    channel_record,
    record,
    schema_record,
    string,
)


class Ending:
    """
    Collect what the summary says.

    :param counts: messages by channel, those of channels without any included.
    """

    def __init__(self) -> None:
        self.counts: Counter[int] = Counter()
        self._groups: dict[Op, list[bytes]] = {
            Op.SCHEMA: [],
            Op.CHANNEL: [],
            Op.STATISTICS: [],
            Op.CHUNK_INDEX: [],
            Op.ATTACHMENT_INDEX: [],
            Op.METADATA_INDEX: [],
        }
        self._start = self._end = 0  # [ns] first and last log time

    @property
    def schemas(self) -> int:
        """Schemas so far."""
        return len(self._groups[Op.SCHEMA])

    @property
    def channels(self) -> int:
        """Channels so far."""
        return len(self._groups[Op.CHANNEL])

    def note_schema(self, schema: Schema) -> None:
        """Repeat a schema."""
        self._groups[Op.SCHEMA].append(schema_record(schema))

    def note_channel(self, channel: Channel) -> None:
        """Repeat a channel."""
        self._groups[Op.CHANNEL].append(channel_record(channel))
        self.counts[channel.id] = 0

    def note_chunk(
        self,
        times: tuple[int, int],
        place: tuple[int, int],
        sizes: tuple[int, int],
        indexes: dict[int, int],
        index_size: int,
    ) -> None:
        """
        Index a chunk.

        :param times: first and last log time in it [ns].
        :param place: place and length of its record [B].
        :param sizes: of its records, compressed and not [B].
        :param indexes: places of its message indexes by channel.
        :param index_size: of these together [B].
        """
        start, end = times
        known = self._groups[Op.CHUNK_INDEX]
        self._start = min(start, self._start) if known else start
        self._end = max(end, self._end) if known else end
        offsets = b''.join(struct.pack('<HQ', *entry) for entry in indexes.items())
        known.append(
            record(
                Op.CHUNK_INDEX,
                CHUNK_INDEX.pack(start, end, *place),
                string(offsets),
                struct.pack('<Q', index_size),
                string('zstd'),
                struct.pack('<QQ', *sizes),
            )
        )

    def note_metadata(self, name: str, place: int, length: int) -> None:
        """Index a Metadata record."""
        where = struct.pack('<QQ', place, length)
        self._groups[Op.METADATA_INDEX].append(record(Op.METADATA_INDEX, where, string(name)))

    def note_attachment(self, about: Attachment, place: int, length: int) -> None:
        """Index an Attachment record."""
        numbers = (place, length, about.log_time, about.create_time, about.data_size)
        self._groups[Op.ATTACHMENT_INDEX].append(
            record(
                Op.ATTACHMENT_INDEX,
                struct.pack('<QQQQQ', *numbers),
                string(about.name),
                string(about.media_type),
            )
        )

    def records(self, place: int, crc: int) -> bytes:
        """
        Return everything from the end of the data section to the end of the file.

        :param place: of the end of the data section [B].
        :param crc: of the data section.
        """
        data_end = record(Op.DATA_END, struct.pack('<I', crc))
        begin = place + len(data_end)
        self._groups[Op.STATISTICS] = [self._statistics()]
        summary = offsets = b''
        for op, members in self._groups.items():
            if members:
                group = b''.join(members)
                where = struct.pack('<BQQ', op, begin + len(summary), len(group))
                offsets += record(Op.SUMMARY_OFFSET, where)
                summary += group
        places = struct.pack('<QQ', begin, begin + len(summary))
        data = summary + offsets + HEAD.pack(Op.FOOTER, FOOTER.size) + places
        return data_end + data + struct.pack('<I', crc32(data)) + MAGIC

    def _statistics(self) -> bytes:
        sizes = {op: len(members) for op, members in self._groups.items()}
        counts = b''.join(struct.pack('<HQ', *entry) for entry in self.counts.items())
        head = STATISTICS.pack(
            self.counts.total(),
            sizes[Op.SCHEMA],
            sizes[Op.CHANNEL],
            sizes[Op.ATTACHMENT_INDEX],
            sizes[Op.METADATA_INDEX],
            sizes[Op.CHUNK_INDEX],
            self._start,
            self._end,
        )
        return record(Op.STATISTICS, head, string(counts))
