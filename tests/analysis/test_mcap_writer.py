"""The shorter way for messages: the file is the one that the library writes."""

from io import BytesIO

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from emir_analysis.mcap_writer import MessageWriter

CHUNK = 2000  # bytes
RNG_SEED = 4


def _file(writer: Writer, stream: BytesIO) -> bytes:
    """300 messages of three channels, the third late, out of order, some of no length."""
    random = np.random.default_rng(RNG_SEED)
    writer.start("ros2", "test")
    schema = writer.register_schema("x/msg/Bytes", "ros2msg", b"byte[] data")
    channels = [writer.register_channel(name, "cdr", schema) for name in ("/a", "/b")]
    for k in range(300):
        if k == 100:
            writer.add_metadata("half", {"way": "there"})
            writer.add_attachment(1, 2, "name", "text/plain", b"text")
            channels.append(writer.register_channel("/c", "cdr", schema))
        if k == 200:
            writer.flush()  # type: ignore[no-untyped-call]
        data = random.bytes(random.integers(0, 300))
        time = int(random.integers(10**9, 2**63))
        writer.add_message(channels[k % len(channels)], time, data, time + k, k)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD])
def test_the_file_is_the_librarys_own_byte_by_byte(compression: CompressionType) -> None:
    theirs, ours = BytesIO(), BytesIO()
    expected = _file(Writer(theirs, chunk_size=CHUNK, compression=compression), theirs)
    assert _file(MessageWriter(ours, CHUNK, compression), ours) == expected
