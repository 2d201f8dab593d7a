"""Checks a recording of krait as a careful public reader would, and prints what it found as one line of JSON.

Usage: python check_with_python.py FILE LAYOUT
Needs: pip install mcap==1.6.0 mcap-protobuf-support==0.6.0

Like `mcap doctor`: every record of the file is read with its CRC checked, every chunk's message indexes are compared with
its messages, every chunk index with its chunk, the statistics with the counts. And the layout: every topic and field that it
names must be in the schemas that the file embeds.
"""

import json
import sys
from collections import Counter

from google.protobuf import descriptor_pb2, descriptor_pool
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Chunk, ChunkIndex, DataEnd, Footer, Message, MessageIndex, Statistics
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap_protobuf.decoder import DecoderFactory


def doctor(path):
    """Faults of the file, as sentences."""
    faults, counts, chunks, indexed, statistics, footer = [], Counter(), {}, {}, None, None
    pending, indexes = None, {}
    whole = open(path, "rb").read()
    with open(path, "rb") as file:
        reader = StreamReader(file, emit_chunks=True, validate_crcs=True)
        for record in reader.records:
            if isinstance(record, Chunk):
                # Decompresses and checks the chunk's own CRC.
                records = breakup_chunk(record, validate_crc=True)
                messages = [r for r in records if isinstance(r, Message)]
                counts.update(m.channel_id for m in messages)
                if record.uncompressed_crc == 0:
                    faults.append("a chunk has no CRC")
                times = [m.log_time for m in messages]
                if times and (min(times), max(times)) != (record.message_start_time, record.message_end_time):
                    faults.append("a chunk's time range is not that of its messages")
                pending, indexes = Counter(m.channel_id for m in messages), Counter()
                chunks[len(chunks)] = record
            elif isinstance(record, MessageIndex):
                indexes[record.channel_id] += len(record.records)
                if pending is not None and pending[record.channel_id] != len(record.records):
                    faults.append(f"the message index of channel {record.channel_id} does not fit its chunk")
            elif isinstance(record, ChunkIndex):
                indexed[record.chunk_start_offset] = record
            elif isinstance(record, Statistics):
                statistics = record
            elif isinstance(record, DataEnd):
                if record.data_section_crc == 0:
                    faults.append("the data section has no CRC")
            elif isinstance(record, Footer):
                footer = record
    if footer is None or footer.summary_crc == 0 or footer.summary_start == 0:
        faults.append("the footer has no summary or no CRC")
    if len(indexed) != len(chunks):
        faults.append(f"{len(chunks)} chunks and {len(indexed)} chunk indexes")
    for offset, index in indexed.items():
        if whole[offset] != Opcode.CHUNK:
            faults.append(f"a chunk index points at byte {offset}, where no chunk is")
        for channel_id, at in index.message_index_offsets.items():
            if whole[at] != Opcode.MESSAGE_INDEX:
                faults.append(f"the message index of channel {channel_id} is not at byte {at}")
    if statistics is None or dict(statistics.channel_message_counts) != dict(counts):
        faults.append("the statistics do not count what the chunks hold")
    return faults


def field_of(schema, path):
    """Whether a dotted path is a field of a schema's message."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    message = pool.FindMessageTypeByName(schema.name)
    # An entry of a list, `name[2]`, is there if the list is.
    for name in (part.split("[")[0] for part in filter(None, path.split("."))):
        if message is None or name not in message.fields_by_name:
            return False
        message = message.fields_by_name[name].message_type
    return True


# What `krait console --foxglove` serves and no recording has; tests/tests/console.rs finds them there.
LIVE_ONLY = ("/krait/tracking_error", "/krait/bends")


def layout_faults(layout, summary):
    schemas = {c.topic: summary.schemas[c.schema_id] for c in summary.channels.values()}
    named = []
    for panel in layout["configById"].values():
        named += [p["value"] for p in panel.get("paths", [])] + list(panel.get("topics", {}))
        named += [panel[key] for key in ("topicToRender", "topicPath") if key in panel]
    faults = []
    for path in named:
        topic, _, field = path.partition(".")
        if topic in LIVE_ONLY:
            continue
        if topic not in schemas or not field_of(schemas[topic], field):
            faults.append(f"the layout names {path}, which the file does not have")
    return faults, len(named)


def views(path):
    found = {}
    with open(path, "rb") as file:
        for item in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            if item.schema.name.startswith("foxglove."):
                entry = found.setdefault(item.channel.topic, {"schema": item.schema.name, "messages": 0, "texts": []})
                entry["messages"] += 1
                message = item.decoded_message
                if item.schema.name == "foxglove.Log":
                    entry["texts"].append(message.message)
                elif item.schema.name == "foxglove.SceneUpdate":
                    entry.setdefault("lines", {})[message.entities[0].id] = len(message.entities[0].lines)
                elif item.schema.name == "foxglove.FrameTransforms":
                    stamp = message.transforms[0].timestamp
                    assert stamp.seconds * 10**9 + stamp.nanos == item.message.log_time
                    entry.setdefault("frames", {})[message.transforms[0].child_frame_id] = True
    return found


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python check_with_python.py FILE LAYOUT")
    with open(sys.argv[1], "rb") as file:
        summary = make_reader(file).get_summary()
    faults, n_named = layout_faults(json.load(open(sys.argv[2])), summary)
    print(json.dumps({"doctor": doctor(sys.argv[1]), "layout": faults, "layout_paths": n_named, "views": views(sys.argv[1])}))
