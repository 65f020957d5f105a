// Copyright 2026 DAMADICS FD maintainers
// SPDX-License-Identifier: Apache-2.0
//
// Decode every message of an MCAP file with the parser of Foxglove or of Lichtblick.
//
//   node read.mjs foxglove|lichtblick FILE
//
// Prints one JSON object: for each topic its columns by dotted field name in the order of the
// file, and what the indexed reader finds. Anything that these packages refuse is an error.

import { open } from 'node:fs/promises';
import { MessageReader } from '@foxglove/rosmsg2-serialization';
import { McapIndexedReader, McapStreamReader } from '@mcap/core';
import * as zstd from 'fzstd';

const [maker, path] = process.argv.slice(2);
const { parse } = await import(`@${maker}/rosmsg`);
const decompressHandlers = {
  zstd: (data, size) => zstd.decompress(data, new Uint8Array(Number(size))),
};

const file = await open(path, 'r');
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (offset, length) => {
    const buffer = new Uint8Array(Number(length));
    await file.read(buffer, 0, Number(length), Number(offset));
    return buffer;
  },
};

const indexed = await McapIndexedReader.Initialize({ readable, decompressHandlers });
let found = 0;
for await (const message of indexed.readMessages()) {
  found += message.data.byteLength > 0 ? 1 : 0;
}
const metadata = [];
for await (const record of indexed.readMetadata()) {
  metadata.push(record.name);
}

function flatten(value, name, put) {
  if (typeof value === 'bigint') {
    put(name, String(value));
  } else if (ArrayBuffer.isView(value)) {
    put(name, Array.from(value, (item) => (typeof item === 'bigint' ? String(item) : item)));
  } else if (Array.isArray(value)) {
    value.forEach((item, i) => flatten(item, `${name}.${i}`, put));
  } else if (typeof value === 'object' && value !== null) {
    for (const [key, item] of Object.entries(value)) {
      flatten(item, name ? `${name}.${key}` : key, put);
    }
  } else {
    put(name, typeof value === 'number' && !Number.isFinite(value) ? String(value) : value);
  }
}

const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
stream.append(new Uint8Array(await readable.read(0, await readable.size())));
const schemas = new Map();
const channels = new Map();
const topics = {};
for (let record; (record = stream.nextRecord()); ) {
  if (record.type === 'Schema') {
    schemas.set(record.id, record);
  } else if (record.type === 'Channel' && !channels.has(record.id)) {
    const schema = schemas.get(record.schemaId);
    const text = new TextDecoder().decode(schema.data);
    channels.set(record.id, {
      topic: record.topic,
      reader: new MessageReader(parse(text, { ros2: true })),
    });
    topics[record.topic] = {
      type: schema.name,
      encoding: record.messageEncoding,
      metadata: Object.fromEntries(record.metadata),
      count: 0,
      log_time: [],
      columns: {},
    };
  } else if (record.type === 'Message') {
    const { topic, reader } = channels.get(record.channelId);
    const entry = topics[topic];
    entry.count += 1;
    entry.log_time.push(String(record.logTime));
    flatten(reader.readMessage(record.data), '', (name, value) => {
      (entry.columns[name] ??= []).push(value);
    });
  }
}
const { profile } = indexed.header;
console.log(JSON.stringify({ profile, indexed: found, metadata, topics }));
