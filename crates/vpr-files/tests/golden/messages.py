"""Protobuf messages of Caffe, as far as golden files need them."""

import struct


def varint(value):
    out = b""
    while value >= 0x80:
        out += bytes([value & 0x7F | 0x80])
        value >>= 7
    return out + bytes([value])


def message(number, body):
    return varint(number << 3 | 2) + varint(len(body)) + body


def number(field, value):
    return varint(field << 3) + varint(value)


def blob(values, legacy=False, packed=True, double=False):
    shape = values.shape
    if legacy:
        shape = (1,) * (4 - len(shape)) + shape
        out = b"".join(number(1 + axis, length) for axis, length in enumerate(shape))
    else:
        out = message(7, message(1, b"".join(map(varint, shape))))
    flat = values.ravel().tolist()
    if double:
        return out + message(8, struct.pack(f"<{len(flat)}d", *flat))
    if packed:
        return out + message(5, struct.pack(f"<{len(flat)}f", *flat))
    return out + b"".join(varint(5 << 3 | 5) + struct.pack("<f", value) for value in flat)


def text(field, value):
    return message(field, value.encode())
