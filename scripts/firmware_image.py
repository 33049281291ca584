#!/usr/bin/env python3
"""usage: firmware_image.py IMAGE.bin OUT.bin OUT.uf2

Puts the CRC of the boot stage into a flash image of the RP2040 and writes it again, as bytes and as UF2 (a file that the
chip's ROM takes when it is copied onto the drive RPI-RP2).
"""
import pathlib
import struct
import sys

FLASH = 0x10000000
FAMILY_RP2040 = 0xE48BFF56
PAYLOAD = 256


def crc32(data):
    """Polynomial 04C11DB7, begins at FFFFFFFF, most significant bit first, not inverted at the end."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = (crc << 1 ^ 0x04C11DB7 if crc & 0x80000000 else crc << 1) & 0xFFFFFFFF
    return crc


def with_checksum(image):
    return image[:252] + struct.pack('<I', crc32(image[:252])) + image[256:]


def uf2(image):
    blocks = [image[i:i + PAYLOAD].ljust(PAYLOAD, b'\0') for i in range(0, len(image), PAYLOAD)]
    out = b''
    for number, block in enumerate(blocks):
        head = struct.pack('<8I', 0x0A324655, 0x9E5D5157, 0x2000, FLASH + PAYLOAD * number, PAYLOAD, number, len(blocks),
                           FAMILY_RP2040)
        out += head + block.ljust(476, b'\0') + struct.pack('<I', 0x0AB16F30)
    return out


def main():
    source, binary, flashable = map(pathlib.Path, sys.argv[1:4])
    image = with_checksum(source.read_bytes())
    binary.write_bytes(image)
    flashable.write_bytes(uf2(image))


if __name__ == '__main__':
    main()
