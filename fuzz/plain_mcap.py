#!/usr/bin/env python3
"""Rewrites a softjam .mcap with Python's writer: nothing packed, no checksums, the result in front of the messages.

corpus/recording/plain.mcap is what it makes of seed.mcap:
    softjam record -N 16 --phi 0.9 --steps 3 --vertices 8 --every 1 --mcap corpus/recording/seed.mcap
    plain_mcap.py corpus/recording/seed.mcap corpus/recording/plain.mcap       (pip install mcap)
"""

import sys

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

with open(sys.argv[1], "rb") as source, open(sys.argv[2], "wb") as sink:
    reader = make_reader(source)
    writer = Writer(sink, compression=CompressionType.NONE, enable_crcs=False, use_statistics=False)
    writer.start(profile="", library="plain")
    for attachment in reader.iter_attachments():
        writer.add_attachment(
            attachment.create_time, attachment.log_time, attachment.name, attachment.media_type, attachment.data
        )
    schemas, channels = {}, {}
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        if schema.id not in schemas:
            schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, b"")
        if channel.id not in channels:
            channels[channel.id] = writer.register_channel(
                channel.topic, channel.message_encoding, schemas[schema.id]
            )
        writer.add_message(
            channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
        )
    # The writer keeps its only chunk open to the end, so these come in front of it.
    for metadata in reader.iter_metadata():
        writer.add_metadata(metadata.name, metadata.metadata)
    writer.finish()
