"""The MCAP library's writer, with a shorter way for messages.

The library takes some fifteen calls for a message, most of them for a number each. Here its head is
packed in one, and so is a chunk's index. Chunks, checksums, compression and summary are the
library's, and so are the objects that this fills: the file is the same, byte by byte.
"""

import struct
from itertools import chain
from typing import IO, Any

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import MessageIndex, Statistics
from mcap.writer import CompressionType, Writer

MESSAGE = int(Opcode.MESSAGE)  # an enum's member takes longer to pack
_HEAD = struct.Struct("<BQHIQQ")  # opcode, length; channel, sequence, log time, publish time
_LENGTH_BEFORE = struct.calcsize("<BQ")  # of the head: does not count as the record's length


class _Index(MessageIndex):
    """Where the messages of a channel stand in a chunk: (log time, offset) each."""

    def write(self, stream: RecordBuilder) -> None:
        """Write the record."""
        numbers = 2 * len(self.records)
        stream.start_record(Opcode.MESSAGE_INDEX)
        stream.write(struct.pack("<HI", self.channel_id, 8 * numbers))
        stream.write(struct.pack(f"<{numbers}Q", *chain.from_iterable(self.records)))
        stream.finish_record()  # type: ignore[no-untyped-call]  # mcap's, untyped


class MessageWriter(Writer):
    """Writes an MCAP file; chunk_size: bytes from which a chunk is finished.

    statistics: of the messages so far.
    """

    def __init__(self, output: IO[bytes], chunk_size: int, compression: CompressionType) -> None:
        super().__init__(output, chunk_size=chunk_size, compression=compression)
        self._size = chunk_size
        inner: Any = self  # the library has no other door to these three
        self._chunk = inner._Writer__chunk_builder  # noqa: SLF001
        self.statistics: Statistics = inner._Writer__statistics  # noqa: SLF001
        self._finish_chunk = inner._Writer__finalize_chunk  # noqa: SLF001

    def add_message(
        self, channel_id: int, log_time: int, data: bytes, publish_time: int, sequence: int = 0
    ) -> None:
        """Add a message to the chunk; times in ns."""
        chunk, whole = self._chunk, self.statistics
        if whole.message_count == 0 or log_time < whole.message_start_time:
            whole.message_start_time = log_time
        if log_time > whole.message_end_time:  # noqa: PLR1730 (max() takes four times as long)
            whole.message_end_time = log_time
        if chunk.num_messages == 0 or log_time < chunk.message_start_time:
            chunk.message_start_time = log_time
        if log_time > chunk.message_end_time:  # noqa: PLR1730
            chunk.message_end_time = log_time
        whole.message_count += 1
        whole.channel_message_counts[channel_id] += 1
        chunk.num_messages += 1
        stream = chunk.record_writer
        at = stream.count
        if channel_id not in chunk.message_indices:
            chunk.message_indices[channel_id] = _Index(channel_id, [])
        chunk.message_indices[channel_id].records.append((log_time, at))
        length = _HEAD.size - _LENGTH_BEFORE + len(data)
        head = _HEAD.pack(MESSAGE, length, channel_id, sequence, log_time, publish_time)
        stream.write(head + data)
        if at + len(head) + len(data) > self._size:
            self._finish_chunk()
