"""Reads a recording of krait with the public Python mcap reader and says what it found, as one line of JSON.

Usage: python read_with_python.py FILE
Needs: pip install mcap==1.6.0 mcap-protobuf-support==0.6.0

Nothing here knows krait: every message is decoded with the descriptors that the file itself carries. A file that was cut is
read up to where it breaks off; `indexed` is false then and `error` says why.
"""

import json
import math
import sys

from mcap.reader import NonSeekingReader, make_reader
from mcap_protobuf.decoder import DecoderFactory


def plain(message):
    """The fields of a message as JSON values; NaN, which JSON lacks, becomes the string "NaN"."""
    fields = {}
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        if field.is_repeated:
            fields[field.name] = len(value)
        elif field.message_type is not None:
            fields[field.name] = plain(value)
        elif isinstance(value, float) and not math.isfinite(value):
            fields[field.name] = "NaN" if math.isnan(value) else str(value)
        elif isinstance(value, bytes):
            fields[field.name] = value.hex()
        else:
            fields[field.name] = value
    return fields


def note(channels, schema, channel, message, decoded):
    name = schema.name if schema else ""
    entry = channels.setdefault(
        channel.topic,
        {
            "schema": name,
            "messages": 0,
            "decoded": 0,
            "first_fields": [],
            "first": None,
            "last": None,
            "t_first_ns": message.log_time,
            "t_last_ns": message.log_time,
        },
    )
    entry["messages"] += 1
    entry["t_first_ns"] = min(entry["t_first_ns"], message.log_time)
    entry["t_last_ns"] = max(entry["t_last_ns"], message.log_time)
    if decoded.DESCRIPTOR.full_name == name:
        entry["decoded"] += 1
        entry["last"] = decoded
        if entry["first"] is None:
            entry["first"] = plain(decoded)
            entry["first_fields"] = list(entry["first"])


def read(path):
    found = {"channels": {}, "metadata": {}, "attachments": {}, "indexed": False}
    with open(path, "rb") as file:
        try:
            summary = make_reader(file).get_summary()
            found["indexed"] = summary is not None and len(summary.chunk_indexes) > 0
        except Exception as error:
            found["error"] = f"no summary: {type(error).__name__}: {error}"
    with open(path, "rb") as file:
        if found["indexed"]:
            reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        else:
            reader = NonSeekingReader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        try:
            for item in reader.iter_decoded_messages(log_time_order=False):
                note(found["channels"], item.schema, item.channel, item.message, item.decoded_message)
        except Exception as error:
            found["error"] = f"broke off: {type(error).__name__}: {error}"
    with open(path, "rb") as file:
        reader = make_reader(file) if found["indexed"] else NonSeekingReader(file)
        try:
            for record in reader.iter_metadata():
                found["metadata"][record.name] = record.metadata
        except Exception as error:
            found.setdefault("error", f"metadata broke off: {type(error).__name__}: {error}")
    with open(path, "rb") as file:
        reader = make_reader(file) if found["indexed"] else NonSeekingReader(file)
        try:
            for record in reader.iter_attachments():
                found["attachments"][record.name] = len(record.data)
        except Exception as error:
            found.setdefault("error", f"attachments broke off: {type(error).__name__}: {error}")
    for entry in found["channels"].values():
        entry["last"] = None if entry["last"] is None else plain(entry["last"])
    return found


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python read_with_python.py FILE")
    print(json.dumps(read(sys.argv[1]), allow_nan=False))
