#!/usr/bin/env python3
"""Reads MCAP files with the libraries of Foxglove and decodes every message. One JSON line per topic.

  pip install mcap mcap-protobuf-support mcap-ros2-support rosbags
  python3 mcap_check.py FILE.mcap ...

Checksums are verified, counts and times are compared with the summary, protobuf and JSON are decoded by the schemas in the
file, ROS messages by the definition in the file and once more by that of ROS 2 Humble (rosbags), which must write them back. Files with the profile of ROS 2 are
read whole by rosbags. Exit code 1 if
anything does not fit."""

import argparse
import collections
import json
import pathlib
import sys

from google.protobuf.message import Message
from google.protobuf.unknown_fields import UnknownFieldSet
from mcap.reader import NonSeekingReader, make_reader
from mcap.well_known import MessageEncoding
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore


class Json:
    """The decoder that the libraries lack."""

    def decoder_for(self, encoding, schema):
        if encoding != MessageEncoding.JSON:
            return None
        rules = json.loads(schema.data) if schema and schema.data else {}

        def decode(data):
            value = json.loads(data)
            if rules.get("type") == "object":
                missing = [name for name in rules.get("required", []) if name not in value]
                unknown = [n for n in value if rules.get("properties") and n not in rules["properties"]]
                if not isinstance(value, dict) or missing or unknown:
                    raise ValueError(f"against its schema: missing {missing}, unknown {unknown}")
            return value

        return decode


def fields(value):
    """All that a message says, as plain values, whoever decoded it."""
    if isinstance(value, Message):
        return {f.name: fields(v) for f, v in value.ListFields()}
    if hasattr(value, "__slots__"):
        return {name.lstrip("_"): fields(getattr(value, name)) for name in value.__slots__}
    if hasattr(value, "__dataclass_fields__"):
        # Constants of the definition are no fields.
        names = [name for name in value.__dataclass_fields__ if name != "__msgtype__" and not name.isupper()]
        return {name: fields(getattr(value, name)) for name in names}
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, (list, tuple, bytes, bytearray)):
        return [fields(part) for part in value]
    return value


def read_by_rosbags(path):
    """How many messages rosbags decodes of a file with the profile of ROS 2; None without that profile."""
    with open(path, "rb") as file:
        if make_reader(file).get_header().profile != "ros2":
            return None
    with AnyReader([pathlib.Path(path)]) as bag:
        return sum(1 for connection, _, data in bag.messages() if bag.deserialize(data, connection.msgtype) is not None)


def check(path, humble):
    """Findings about one file: by topic, and what is wrong."""
    wrong = []
    topics = collections.defaultdict(lambda: {"messages": 0, "bytes": 0, "unsorted": 0, "last": 0})
    with open(path, "rb") as file:
        reader = NonSeekingReader(file, validate_crcs=True, decoder_factories=[Protobuf(), Ros2(), Json()])
        for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            topic = topics[channel.topic]
            topic["schema"] = schema.name if schema else None
            topic["encoding"] = channel.message_encoding
            topic["messages"] += 1
            topic["bytes"] += len(message.data)
            topic["unsorted"] += message.log_time < topic["last"]
            topic["last"] = message.log_time
            if channel.message_encoding == "protobuf" and len(UnknownFieldSet(decoded)):
                wrong.append(f"{channel.topic}: fields that the schema does not know")
            if channel.message_encoding == "cdr":
                other = humble.deserialize_cdr(message.data, schema.name)
                if humble.serialize_cdr(other, schema.name).tobytes() != bytes(message.data):
                    wrong.append(f"{channel.topic}: ROS 2 Humble writes other bytes")
                if repr(fields(other)) != repr(fields(decoded)):
                    wrong.append(f"{channel.topic}: {str(fields(other))[:200]} by Humble, {str(fields(decoded))[:200]} by the file")
    with open(path, "rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    if summary is None or summary.statistics is None:
        wrong.append("no summary: players have to read the whole file first")
    else:
        count = sum(topic["messages"] for topic in topics.values())
        bag = read_by_rosbags(path)
        if bag not in (None, count):
            wrong.append(f"{count} messages, {bag} by rosbags")
        if summary.statistics.message_count != count:
            wrong.append(f"{count} messages, {summary.statistics.message_count} by the summary")
        silent = {channel.topic for channel in summary.channels.values()} - set(topics)
        for topic in sorted(silent):
            topics[topic] = {"messages": 0}
    return topics, wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+")
    humble, failed = get_typestore(Stores.ROS2_HUMBLE), False
    for path in parser.parse_args().files:
        topics, wrong = check(path, humble)
        for topic, found in sorted(topics.items()):
            found.pop("last", None)
            print(json.dumps({"file": path, "topic": topic, **found}))
        for finding in sorted(set(wrong))[:20]:
            print(json.dumps({"file": path, "wrong": finding}))
        failed |= bool(wrong)
    sys.exit(failed)


if __name__ == "__main__":
    main()
