#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Turns the small sample scenes into self-contained seeds for gltf_fuzzer: make_fuzzer_seeds.py ASSETS OUTPUT

Buffers and pictures beside a .gltf become data URIs, since the fuzzer opens no files. Larger scenes keep their
JSON only, with buffers cut to nothing, so that all extensions are among the seeds.
"""
import base64
import json
import pathlib
import struct
import sys

LARGEST_SEED = 100_000
TINY_PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==")


def as_data_uri(data, mime):
    return f"data:{mime};base64," + base64.b64encode(data).decode()


def embed(document, folder, with_data):
    for buffer in document.get("buffers", []):
        if "uri" in buffer and not buffer["uri"].startswith("data:"):
            data = (folder / buffer["uri"]).read_bytes() if with_data else b""
            buffer["uri"] = as_data_uri(data, "application/octet-stream")
    for image in document.get("images", []):
        if "uri" in image and not image["uri"].startswith("data:"):
            data = (folder / image["uri"]).read_bytes()
            image["uri"] = as_data_uri(data if with_data and len(data) < 20_000 else TINY_PNG, "image/png")
    return json.dumps(document, separators=(",", ":")).encode()


def as_glb(document, folder):
    """The first buffer as the binary chunk."""
    data = (folder / document["buffers"][0].pop("uri")).read_bytes()
    data += b"\0" * (-len(data) % 4)
    text = embed(document, folder, True)
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def main():
    assets, output = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    output.mkdir(parents=True, exist_ok=True)
    for file in sorted(assets.rglob("*.gltf")):
        text = file.read_text()
        seed = embed(json.loads(text), file.parent, True)
        if len(seed) > LARGEST_SEED:
            seed = embed(json.loads(text), file.parent, False)
        if len(seed) <= LARGEST_SEED:
            (output / (file.stem + ".gltf")).write_bytes(seed)
        document = json.loads(text)
        if len(document.get("buffers", [])) == 1 and not document["buffers"][0]["uri"].startswith("data:"):
            binary = as_glb(document, file.parent)
            if len(binary) <= LARGEST_SEED:
                (output / (file.stem + ".glb")).write_bytes(binary)
    print(f"{len(list(output.iterdir()))} seeds in {output}")


if __name__ == "__main__":
    main()
