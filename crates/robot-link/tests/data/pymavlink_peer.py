#!/usr/bin/env python3
"""The same frames by pymavlink, for tests/golden.rs and tests/pymavlink.rs.

    python3 -m venv venv && venv/bin/pip install pymavlink==2.4.50
    venv/bin/python pymavlink_peer.py golden     the frames that tests/golden.rs holds, one a line: name, hex
    venv/bin/python pymavlink_peer.py echo       reads frames as hex lines ("plain HEX" or "signed HEX", which is verified); prints
                                                 the frame that pymavlink makes of its fields (signed again with the same time
                                                 stamp), then name=numbers for each, as little-endian doubles in hex
"""
import os
import struct
import sys

os.environ["MAVLINK20"] = "1"
from pymavlink.dialects.v20 import common as mav  # noqa: E402

KEY = bytes(range(32))


class Sink:
    def write(self, data):
        pass


def writer(sequence, signed_at=None, link=3):
    m = mav.MAVLink(Sink(), srcSystem=245, srcComponent=191)
    m.seq = sequence
    if signed_at is not None:
        m.signing.secret_key, m.signing.link_id, m.signing.timestamp = KEY, link, signed_at
        m.signing.sign_outgoing = True
    return m


def golden():
    nan = float("nan")
    frames = {
        "attitude": (11, None, mav.MAVLink_attitude_quaternion_message(4321, 0.5, -0.5, 0.5, 0.5, 0.125, -0.25, 1.5)),
        "position": (12, None, mav.MAVLink_local_position_ned_message(4322, 1.5, -2.5, -3.25, 0.5, 0.25, -0.125)),
        "text": (13, None, mav.MAVLink_statustext_message(4, b"Arming denied: no estimate")),
        "land": (14, None, mav.MAVLink_command_long_message(1, 1, 21, 0, 0, 0, 0, nan, nan, nan, 0)),
        "interval": (15, None, mav.MAVLink_command_long_message(1, 1, 511, 0, 32, 20000, 0, 0, 0, 0, 0)),
        "vehicle": (18, None, mav.MAVLink_sys_status_message(7, 3, 1, 512, 15250, 1234, 63, 1, 2, 3, 4, 5, 6)),
        "battery": (19, None, mav.MAVLink_battery_status_message(1, 1, 3, 2512, [3810, 3805] + [65535] * 8, 1234, 310, -1, 63)),
        "signed heartbeat": (16, 371 * 10**12 // 10, mav.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)),
        "signed timesync": (17, 371 * 10**12 // 10 + 1, mav.MAVLink_timesync_message(0, 5)),
    }
    for name, (sequence, signed_at, message) in frames.items():
        print(name, message.pack(writer(sequence, signed_at)).hex())


def numbers(value):
    values = value.encode() if isinstance(value, str) else value
    values = values if isinstance(values, (bytes, list, tuple)) else [values]
    return "".join(struct.pack("<d", float(v)).hex() for v in values)


def echo():
    reader, signed_reader = mav.MAVLink(Sink()), writer(0, signed_at=1)
    for line in sys.stdin:
        kind, frame = line.split()
        is_signed, frame = kind == "signed", bytes.fromhex(frame)
        (message,) = (signed_reader if is_signed else reader).parse_buffer(frame)
        assert message.get_type() != "BAD_DATA" and message.get_signed() == is_signed, message
        values = {name: getattr(message, name) for name in message.fieldnames}
        # A text is read as str and written as bytes.
        packable = {n: v.encode() if isinstance(v, str) else v for n, v in values.items()}
        out = writer(message.get_seq(), int.from_bytes(frame[-12:-6], "little") if is_signed else None)
        out.srcSystem, out.srcComponent = message.get_srcSystem(), message.get_srcComponent()
        again = type(message)(**packable).pack(out)
        print(again.hex(), *("%s=%s" % (n, numbers(v)) for n, v in values.items()), flush=True)


if __name__ == "__main__":
    {"golden": golden, "echo": echo}[sys.argv[1]]()
