#!/usr/bin/env python3
"""usage: extract_vmlinux.py VMLINUZ VMLINUX: decompresses the kernel within an x86 boot image.

The offsets are those of the boot protocol's setup header: Documentation/arch/x86/boot.rst.
"""
import lzma
import struct
import sys
import zlib

SETUP_SECTS, PAYLOAD = 0x1f1, 0x248


def payload(image):
    sectors = image[SETUP_SECTS] or 4
    offset, length = struct.unpack_from('<II', image, PAYLOAD)
    return image[(sectors + 1) * 512 + offset:][:length]


def decompressed(packed):
    if packed.startswith(b'\xfd7zXZ\0'):
        return lzma.LZMADecompressor().decompress(packed)  # the size that follows the stream is ignored
    if packed.startswith(b'\x1f\x8b'):
        return zlib.decompressobj(31).decompress(packed)
    sys.exit(f'{sys.argv[1]}: compressed in an unknown way, starts with {packed[:6].hex()}')


with open(sys.argv[1], 'rb') as source:
    kernel = decompressed(payload(source.read()))
with open(sys.argv[2], 'wb') as target:
    target.write(kernel)
