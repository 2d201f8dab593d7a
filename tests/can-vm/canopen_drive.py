"""A CiA 402 drive on python-canopen's local node, which nobody here wrote: its SDO server, network management, boot-up, heartbeat, PDO
mapping and emergencies answer krait. Only the axis and the table of states behind them are of this file.

canopen_drive.py NODE INTERFACE
"""

import sys
import time

import can
import canopen
from canopen import objectdictionary as od

SYNC, MASTER = 0x80, 127
# Fastest motion, counts/s, how fast it gains or loses speed, counts/s2, and the longest time that a step of it stands for, s.
FASTEST, GAIN, LONGEST = 600_000.0, 1e8, 0.02
NO_HEARTBEAT = 0x8130
OPERATION_ENABLED, QUICK_STOP_ACTIVE = 0x27, 0x07

KINDS = {"u8": od.UNSIGNED8, "u16": od.UNSIGNED16, "u32": od.UNSIGNED32, "i8": od.INTEGER8, "i16": od.INTEGER16, "i32": od.INTEGER32}

# Index, kind, value, and whether the master may write it.
OBJECTS = [
    (0x1000, "u32", 0x0002_0192, False),
    (0x1001, "u8", 0, False),
    (0x1017, "u16", 0, True),
    (0x6007, "i16", 0, True),
    (0x6040, "u16", 0, True),
    (0x6041, "u16", 0x40, False),
    (0x605A, "i16", 6, True),
    (0x6060, "i8", 0, True),
    (0x6064, "i32", 0, False),
    (0x6065, "u32", 100_000, True),
    (0x6076, "u32", 100, False),
    (0x6077, "i16", 0, False),
    (0x607A, "i32", 0, True),
    (0x6085, "u32", 1_000_000, True),
    (0x6502, "u32", 0x80, False),
]
# The same for those with parts: kinds and values from part 1 on.
RECORDS = [
    (0x1016, [("u32", 0)], True),
    (0x1018, [("u32", 0x555), ("u32", 1), ("u32", 0), ("u32", 0)], False),
    (0x1029, [("u8", 0)], True),
    (0x1400, [("u32", 0x8000_0000), ("u8", 1)], True),
    (0x1600, [("u32", 0)] * 8, True),
    (0x1800, [("u32", 0xC000_0000), ("u8", 1)], True),
    (0x1A00, [("u32", 0)] * 8, True),
    (0x60C2, [("u8", 1), ("i8", -3)], True),
]


def dictionary():
    """The objects of the drive."""
    objects = od.ObjectDictionary()

    def variable(index, sub, kind, value, may_write):
        made = od.ODVariable(f"{index:X}.{sub}", index, sub)
        made.data_type, made.access_type, made.default = KINDS[kind], "rw" if may_write else "ro", value
        made.pdo_mappable = index >= 0x6000
        return made

    for index, kind, value, may_write in OBJECTS:
        objects.add_object(variable(index, 0, kind, value, may_write))
    for index, parts, may_write in RECORDS:
        record = od.ODRecord(f"{index:X}", index)
        # Of a mapping the number of its entries is written; of other records it says how many parts there are.
        is_mapping = index in (0x1600, 0x1A00)
        record.add_member(variable(index, 0, "u8", 0 if is_mapping else len(parts), is_mapping))
        for sub, (kind, value) in enumerate(parts, 1):
            record.add_member(variable(index, sub, kind, value, may_write))
        objects.add_object(record)
    return objects


class Drive:
    """The axis and its states behind a node."""

    def __init__(self, number, interface):
        self.network = canopen.Network()
        heard = [0, SYNC, 0x200 + number, 0x600 + number, 0x700 + MASTER]
        filters = [{"can_id": can_id, "can_mask": 0x7FF} for can_id in heard]
        self.network.bus = can.Bus(interface="socketcan", channel=interface, can_filters=filters)
        self.node = canopen.LocalNode(number, dictionary())
        self.node.associate_network(self.network)
        self.place, self.speed, self.status, self.target = 0.0, 0.0, 0x40, 0
        self.is_told, self.moved_s, self.master_s = False, time.monotonic(), None
        self.control_before = 0
        self.network.subscribe(SYNC, self.on_sync)
        self.network.subscribe(0x700 + MASTER, self.on_master)
        self.network.subscribe(0, self.on_management)
        self.node.nmt.send_command(0x81)
        self.node.nmt.send_command(0x80)

    def value(self, index, sub=0):
        """An object as its bytes say."""
        variable = self.node.sdo[index] if sub == 0 else self.node.sdo[index][sub]
        return variable.raw

    def on_management(self, _can_id, data, _timestamp):
        """Cyclic frames are as the master has mapped them by the time it starts the node."""
        if data[0] == 1 and data[1] in (0, self.node.id):
            self.node.tpdo.read()
            self.node.rpdo.read()
            told = self.node.rpdo[1]
            if self.on_told not in told.callbacks:
                told.add_callback(self.on_told)

    def on_told(self, _map):
        self.is_told = True

    def on_master(self, _can_id, _data, _timestamp):
        self.master_s = time.monotonic()

    def on_sync(self, _can_id, _data, _timestamp):
        """Answers with what is, then takes what was told."""
        if self.node.nmt.state != "OPERATIONAL":
            return
        answer = self.node.tpdo[1]
        if answer.enabled:
            for variable in answer:
                if variable.index == 0x6041:
                    in_csp = self.value(0x6060) == 8
                    variable.raw = self.status | 1 << 4 | 1 << 9 | int(in_csp) << 12
                elif variable.index == 0x6064:
                    variable.raw = round(self.place)
            answer.transmit()
        if self.is_told:
            self.is_told = False
            for variable in self.node.rpdo[1]:
                if variable.index == 0x6040:
                    self.control(variable.raw)
                elif variable.index == 0x607A:
                    self.target = variable.raw
        self.go()

    def control(self, word):
        """The standard's table of transitions."""
        rises, self.control_before = word & ~self.control_before, word
        state, asked = self.status, word & 0x8F
        if state == 0x08:
            self.status = 0x40 if rises & 0x80 else 0x08
        elif asked == 0x00:
            self.status = 0x40
        elif asked == 0x06 and state in (0x40, 0x23, OPERATION_ENABLED):
            self.status = 0x21
        elif asked == 0x07 and state in (0x21, OPERATION_ENABLED):
            self.status = 0x23
        elif asked == 0x0F and state in (0x23, QUICK_STOP_ACTIVE):
            self.status = OPERATION_ENABLED
        elif asked == 0x02 and state == OPERATION_ENABLED:
            self.status = QUICK_STOP_ACTIVE
        elif asked == 0x02 and state in (0x21, 0x23):
            self.status = 0x40

    def go(self):
        """Motion since the step before."""
        now_s = time.monotonic()
        elapsed_s = min(now_s - self.moved_s, LONGEST)
        self.moved_s = now_s
        if self.status == OPERATION_ENABLED and elapsed_s > 0:
            way = max(-FASTEST * elapsed_s, min(FASTEST * elapsed_s, self.target - self.place))
            self.place += way
            # What a stop begins with is a speed that a mass can have.
            self.speed += max(-GAIN * elapsed_s, min(GAIN * elapsed_s, way / elapsed_s - self.speed))
        elif self.status == QUICK_STOP_ACTIVE:
            lost = self.value(0x6085) * elapsed_s
            slower = max(0.0, abs(self.speed) - lost) * (1 if self.speed > 0 else -1)
            self.place, self.speed = self.place + 0.5 * (self.speed + slower) * elapsed_s, slower
        else:
            self.speed = 0.0

    def watch(self):
        """The master's heartbeat, and a stop that goes on without any SYNC."""
        consumer = self.value(0x1016, 1)
        patience_s = (consumer & 0xFFFF) * 1e-3
        is_over = self.master_s is not None and time.monotonic() - self.master_s > patience_s
        if patience_s > 0 and consumer >> 16 == MASTER and is_over:
            self.master_s = None
            if self.status == OPERATION_ENABLED:
                self.status = QUICK_STOP_ACTIVE
            self.node.emcy.send(NO_HEARTBEAT, 1)
        if self.status == QUICK_STOP_ACTIVE and time.monotonic() - self.moved_s > 0.001:
            self.go()

    def show(self, index, **_others):
        """What a question about the state or the place is answered."""
        return {0x6041: self.status | 1 << 4 | 1 << 9, 0x6064: round(self.place)}.get(index)

    def run(self):
        """Until it is killed."""
        self.node.add_read_callback(self.show)
        looked_s = 0.0
        while True:
            message = self.network.bus.recv(0.005)
            if message is not None:
                self.network.notify(message.arbitration_id, message.data, message.timestamp)
            if time.monotonic() - looked_s > 0.005:
                looked_s = time.monotonic()
                self.watch()


if __name__ == "__main__":
    Drive(int(sys.argv[1]), sys.argv[2]).run()
