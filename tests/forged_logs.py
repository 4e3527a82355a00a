"""Logs changed the way a careless or ill-willed person would: records cut out, put in, moved, altered; closed again."""

import json
from dataclasses import dataclass, replace

from mcap.reader import make_reader
from mcap.writer import Writer


@dataclass(frozen=True)
class Record:
    """One message of a log."""

    topic: str
    schema: tuple
    data: bytes
    log_time: int
    publish_time: int
    sequence: int

    @property
    def content(self):
        return json.loads(self.data)

    def with_content(self, **parts):
        text = json.dumps(self.content | parts, separators=(",", ":"))
        return replace(self, data=text.encode())


def read_records(path):
    """All messages of a log, in the file's order."""
    with path.open("rb") as file:
        return [
            Record(channel.topic, (schema.name, schema.encoding, schema.data), message.data, message.log_time,
                   message.publish_time, message.sequence)
            for schema, channel, message in make_reader(file).iter_messages(log_time_order=False)
        ]  # fmt: skip


def write_records(path, records):
    """A log of these messages, closed as it should be."""
    schemas, channels = {}, {}
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(library="somebody")
        for record in records:
            if record.schema not in schemas:
                schemas[record.schema] = writer.register_schema(*record.schema)
            if record.topic not in channels:
                channels[record.topic] = writer.register_channel(record.topic, "json", schemas[record.schema])
            writer.add_message(
                channels[record.topic], record.log_time, record.data, record.publish_time, record.sequence
            )
        writer.finish()
    return path
