"""Injects the faults of a world: when each begins, and how it ends."""

from collections.abc import Callable, Collection
from functools import partial
from random import Random
from typing import Final

from dst.faults.change_faults import Blow, ChangeFaults
from dst.faults.kinds import Fault
from dst.vehicles.telemetry import QUANTITIES, REALS, SHARES, Spoiled
from dst.vehicles.vehicle import Vehicle
from dst.world.http_wire import FOREIGN_ANSWERS
from dst.world.machine import Machine, Process
from dst.world.network import PERFECT, Conditions
from dst.world.world import World

MEAN_INTERVAL_S: Final = 60.0
"""Between two occurrences of one fault while vehicles fly."""
MEAN_IN_FLIGHT_S: Final = 25.0
"""Between two occurrences of a fault that only a vehicle in flight can have: flights are short."""
CUT_RATE: Final = 0.3
"""How often the edge server is out of reach just after an answer that matters."""
MEAN_CUT_S: Final = 12.0
SLOWEST_DELAY: Final = 7.5
"""From the rate of slow links to their delay in each direction, up to 1.5 s."""
KILL_RATE: Final = 0.15
"""How often the broker is killed just after it has accepted something."""
MEAN_SUSPENDED_S: Final = 12.0
LONGEST_SUSPENDED_S: Final = 60.0
TAKEN_SHARE: Final = 0.5
"""How often a pilot takes a vehicle while the broker is suspended: what it reads next is old."""
MEAN_KILL_S: Final = 1.0
"""From an acceptance to the fault that follows it."""
POWERLESS_S: Final = (60.0, 180.0)
"""After a power cut the edge server and its relay return within this time: the last of all."""
SWAP_S: Final = 30.0
"""From the end of an aircraft to the start of the one that takes its place."""
BREAK_FACTOR: Final = 60.0
"""While every vehicle is switched off, faults are so many times as rare, and last as long."""


class Faults:
    """Injects the enabled faults until `stop`."""

    def __init__(self, world: World, enabled: Collection[Fault]) -> None:
        self._world = world
        self._enabled = frozenset(enabled)
        self._is_stopped = False
        self.factor = 1.0
        """How many times as rare, and as long, faults are at present."""
        self._machines = world.edge_machine, world.broker_machine
        self._is_silent = False
        """Whether the farm's radio has failed, and its power not yet."""
        self._powerless: set[Process] = set()
        """What the power cut keeps down, also when the other faults have ended."""
        self._kills = world.scheduler.random("kills after acceptances")
        world.http.on_accepted = self._accepted
        lengths = world.scheduler.random("lengths of cuts at changes")
        cut = partial(self._take_down, random=lengths, mean_s=MEAN_CUT_S)
        self._at_changes = [
            ChangeFaults(world, name, blows)
            for fault, name, blows in (
                (Fault.KILLED_AT_CHANGES, "kills at changes", self._kills_at_changes()),
                (Fault.LINK_CUT_AT_CHANGES, "cuts at changes", (Blow("link", 1, cut),)),
            )
            if fault in self._enabled
        ]
        self._degrade()
        self._schedule()

    def stop(self) -> None:
        """End every fault: links and processes are up, nothing is lost any more."""
        self._is_stopped = True
        for one in self._at_changes:
            one.stop()
        world = self._world
        for path in (*world.up.values(), *world.down.values()):
            path.conditions, path.is_up = PERFECT, True
        world.cloud.is_up, world.cloud.answer_loss = True, 0.0
        world.broker.download_failure_share = 0.0
        world.broker.resume()
        world.http.restore()
        for machine in self._machines:
            machine.restore()
            machine.set_clock()
        for process in self._processes.values():
            if not process.is_up and process not in self._powerless:
                process.start()
        for system, vehicle in world.vehicles.items():
            vehicle.has_position = vehicle.knows_battery = True
            if isinstance(vehicle, Vehicle):
                vehicle.spoiled = None
            world.remove_twin(system)
            world.connected(system)
        world.scheduler.note("faults", "-", "end")

    @property
    def _processes(self) -> dict[Fault, Process]:
        world = self._world
        return {
            Fault.BROKER_KILLED: world.broker,
            Fault.EDGE_KILLED: world.edge,
            Fault.RELAY_KILLED: world.relay,
        }

    def _kills_at_changes(self) -> tuple[Blow, ...]:
        """Give how programs are killed near changes: what the broker alone holds is most."""
        random = self._world.scheduler.random("starts after changes")
        broker, edge, relay = (self._kill(*one) for one in self._processes.items())
        return (
            Blow("broker", 6, lambda _system: broker(random)),
            Blow("edge server", 2, lambda _system: edge(random)),
            Blow("relay", 1, lambda _system: relay(random)),
            Blow("vehicle", 3, self._reboot_at_change),
        )

    def _reboot_at_change(self, system: int) -> None:
        vehicle = self._world.vehicles[system]
        if vehicle.is_on:
            self._world.scheduler.note("faults", f"vehicle {system}", "reboot at a change")
            vehicle.reboot()

    def _degrade(self) -> None:
        """Set the rates that hold until the end."""
        world = self._world

        def rate(fault: Fault) -> float:
            drawn = world.scheduler.random(f"rate/{fault}").uniform(0.02, 0.2)
            return drawn if fault in self._enabled else 0.0

        conditions = Conditions(
            loss=rate(Fault.LOSS),
            duplication=rate(Fault.DUPLICATION),
            corruption=rate(Fault.CORRUPTION) / 2.0,
            delay_s=PERFECT.delay_s + SLOWEST_DELAY * rate(Fault.LINK_SLOW),
            jitter_s=5.0 * rate(Fault.REORDERING),
        )
        for path in (*world.up.values(), *world.down.values()):
            path.conditions = conditions
        world.http.request_loss = rate(Fault.EDGE_REQUESTS_LOST)
        world.http.answer_loss = rate(Fault.EDGE_ANSWERS_LOST)
        world.http.stall_rate = rate(Fault.EDGE_ANSWERS_STALLED) / 4.0
        world.http.foreign_rate = rate(Fault.EDGE_ANSWERS_FOREIGN)
        world.http.poison_rate = 2.0 * rate(Fault.REPORT_ALWAYS_FAILS)
        if Fault.EDGE_UNREACHABLE in self._enabled:
            random = world.scheduler.random("cuts")
            world.http.cut_rate = CUT_RATE
            world.http.on_cut = lambda: self._restore_edge(random, MEAN_CUT_S)
        world.cloud.answer_loss = rate(Fault.CLOUD_ANSWERS_LOST)
        world.broker.download_failure_share = rate(Fault.PICTURES)

    def _schedule(self) -> None:
        """Have each enabled fault that comes and goes begin."""
        actions: dict[Fault, Callable[[Random], None]] = {
            Fault.LINK_DOWN: self._link_down,
            Fault.EDGE_UNREACHABLE: self._edge_unreachable,
            Fault.EDGE_ANSWERS_FOREIGN: self._enter_portal,
            Fault.CLOUD_UNREACHABLE: self._cloud_unreachable,
            Fault.VEHICLE_REBOOTED: self._reboot,
            Fault.NOT_A_NUMBER: self._spoil_quantity,
            Fault.POSITION_UNKNOWN: self._spoil("has_position"),
            Fault.BATTERY_UNKNOWN: self._spoil("knows_battery"),
            **{fault: self._kill(fault, process) for fault, process in self._processes.items()},
            Fault.POWER_LOST: self._lose_power,
            Fault.CLOCKS: lambda random: random.choice(self._machines).step_clock(random),
            Fault.SWAPPED: self._swap,
            Fault.TWICE: self._add_twin,
            Fault.DISK_FULL: self._trouble_disk(Machine.fill),
            Fault.DISK_READ_ONLY: self._trouble_disk(Machine.protect),
            Fault.DISK_SLOW: self._trouble_disk(Machine.slow_down),
            Fault.DATABASE_LOCKED: self._trouble_disk(Machine.lock),
        }
        for fault, action in actions.items():
            if fault in self._enabled:
                self._repeat(action, self._world.scheduler.random(fault))
        in_flight = {
            Fault.PILOT: self._take_over,
            Fault.BROKER_SUSPENDED: self._suspend_broker,
            Fault.VEHICLE_FAILS: self._fail_vehicle,
            Fault.POWER_CUT: self._cut_power,
            Fault.REBOOTED_IN_FLIGHT: self._reboot_in_flight,
        }
        for fault, action in in_flight.items():
            if fault in self._enabled:
                self._repeat(action, self._world.scheduler.random(fault), MEAN_IN_FLIGHT_S)

    def _repeat(
        self, action: Callable[[Random], None], random: Random, mean_s: float = MEAN_INTERVAL_S
    ) -> None:
        def act() -> None:
            if self._is_stopped:
                return
            if random.random() * self.factor < 1.0:
                action(random)
            self._repeat(action, random, mean_s)

        self._world.scheduler.after(random.expovariate(1.0 / mean_s), act)

    def _later(self, delay_s: float, action: Callable[[], None]) -> None:
        """Do an action that ends a fault, unless all have ended already."""
        delay_s *= self.factor
        self._world.scheduler.after(delay_s, lambda: None if self._is_stopped else action())

    def _link_down(self, random: Random) -> None:
        world = self._world
        flying = [number for number, one in world.vehicles.items() if one.is_flying]
        self._take_down(random.choice(flying or list(world.vehicles)), random, 25.0)

    def _take_down(self, system: int, random: Random, mean_s: float) -> None:
        world = self._world
        paths = [world.up[system], world.down[system]]
        if random.random() < 0.3:  # One direction alone
            paths = [random.choice(paths)]
        world.scheduler.note("faults", f"vehicle {system}", f"{len(paths)} paths down")
        for path in paths:
            path.is_up = False

        def restore() -> None:
            world.scheduler.note("faults", f"vehicle {system}", "paths up")
            for path in paths:
                path.is_up = True
            world.connected(system)

        self._later(random.expovariate(1.0 / mean_s), restore)

    def _edge_unreachable(self, random: Random) -> None:
        self._world.http.is_up = False
        self._restore_edge(random, 25.0)

    def _restore_edge(self, random: Random, mean_s: float) -> None:
        http = self._world.http
        self._world.scheduler.note("faults", "broker", "edge server unreachable")
        self._later(random.expovariate(1.0 / mean_s), lambda: setattr(http, "is_up", True))

    def _enter_portal(self, random: Random) -> None:
        """Have somebody else answer every request for a while: a network that wants a sign-in."""
        http = self._world.http
        http.portal = random.choice(FOREIGN_ANSWERS)
        self._world.scheduler.note("faults", "broker", f"all answers are {http.portal[:12]!r}")
        self._later(random.expovariate(1.0 / 10.0), lambda: setattr(http, "portal", None))

    def _cloud_unreachable(self, random: Random) -> None:
        cloud = self._world.cloud
        cloud.is_up = False
        self._world.scheduler.note("faults", "relay", "cloud unreachable")
        self._later(random.expovariate(1.0 / 60.0), lambda: setattr(cloud, "is_up", True))

    def _reboot(self, random: Random) -> None:
        system = random.choice(list(self._world.vehicles))
        vehicle = self._world.vehicles[system]
        if vehicle.is_on and not vehicle.is_flying:
            self._world.scheduler.note("faults", f"vehicle {system}", "reboot")
            vehicle.reboot()

    def _add_twin(self, random: Random) -> None:
        """Have another aircraft with the system id of one that is on, for a while."""
        world, system = self._world, random.choice(list(self._world.vehicles))
        if not world.vehicles[system].is_on:
            return
        world.scheduler.note("faults", f"vehicle {system}", "another with its system id")
        world.add_twin(system)
        self._later(random.expovariate(1.0 / 20.0), partial(world.remove_twin, system))

    def _swap(self, random: Random) -> None:
        """Have another aircraft with the same system id take the place of one that stands."""
        system = random.choice(list(self._world.vehicles))
        vehicle = self._world.vehicles[system]
        is_idle = vehicle.is_on and not vehicle.is_flying and not vehicle.armed
        if isinstance(vehicle, Vehicle) and is_idle:
            self._world.scheduler.note("faults", f"vehicle {system}", "another aircraft")
            vehicle.switch_off()

            def arrive() -> None:
                vehicle.swap()
                if self._world.is_break:
                    vehicle.switch_off()

            self._world.scheduler.after(SWAP_S, arrive)

    def _reboot_in_flight(self, random: Random) -> None:
        vehicles = self._world.vehicles
        flying = [system for system, vehicle in vehicles.items() if vehicle.is_flying]
        if flying and random.random() < 0.5:
            system = random.choice(flying)
            self._world.scheduler.note("faults", f"vehicle {system}", "reboot in flight")
            vehicles[system].reboot()

    def _fail_vehicle(self, random: Random) -> None:
        """Have a vehicle that flies lose its position or a motor, and act by its own failsafe."""
        vehicles = self._world.vehicles.values()
        flying = [one for one in vehicles if one.is_flying and one.pilot_since_s is None]
        if flying:
            vehicle = random.choice(flying)
            vehicle.fail(lands=random.random() < 0.5)

    def _spoil_quantity(self, random: Random) -> None:
        """Have a vehicle send values that are no numbers, or none that can be, for a while."""
        vehicle = random.choice(list(self._world.vehicles.values()))
        if not isinstance(vehicle, Vehicle):
            return
        values = random.choice(REALS), random.choice(SHARES)
        vehicle.spoiled = Spoiled(random.choice(list(QUANTITIES)), *values)
        self._world.scheduler.note("faults", f"vehicle {vehicle.system}", f"{vehicle.spoiled}")
        self._later(random.expovariate(1.0 / 12.0), lambda: setattr(vehicle, "spoiled", None))

    def _spoil(self, value: str) -> Callable[[Random], None]:
        """Have a vehicle not know its position or its battery for a while."""

        def spoil(random: Random) -> None:
            vehicle = random.choice(list(self._world.vehicles.values()))
            self._world.scheduler.note("faults", f"vehicle {vehicle.system}", f"not {value}")
            setattr(vehicle, value, False)
            self._later(random.expovariate(1.0 / 8.0), lambda: setattr(vehicle, value, True))

        return spoil

    def _take_over(self, random: Random) -> None:
        """Take over a vehicle that flies, whatever it does: a mission, an abort, its way home."""
        vehicles = self._world.vehicles.values()
        ours = [one for one in vehicles if one.is_flying and one.pilot_since_s is None]
        if not ours:
            return
        vehicle = random.choice(ours)
        vehicle.take_over()

        def release() -> None:
            if vehicle.pilot_since_s is not None:
                vehicle.release()

        self._world.scheduler.after(random.uniform(5.0, 120.0), release)

    def _suspend_broker(self, random: Random) -> None:
        """Have the broker stand still, for longer than a link takes to be lost or not."""
        world = self._world
        if not world.broker.is_running:
            return
        world.scheduler.note("faults", "broker", "suspended")
        world.broker.suspend()

        def resume() -> None:
            world.scheduler.note("faults", "broker", "resumed")
            world.broker.resume()
            for system in world.vehicles:
                world.connected(system)

        lasting_s = min(random.expovariate(1.0 / MEAN_SUSPENDED_S), LONGEST_SUSPENDED_S)
        self._later(lasting_s, resume)
        if Fault.PILOT in self._enabled and random.random() < TAKEN_SHARE:
            self._later(random.uniform(0.0, lasting_s), partial(self._take_over, random))

    def _cut_power(self, random: Random) -> None:
        """Have the farm's radio fail, and soon its machines."""
        world = self._world
        if not any(vehicle.is_flying for vehicle in world.vehicles.values()):
            return
        world.scheduler.note("faults", "farm", "the radio sends no more")
        for path in world.down.values():
            path.is_up = False
        self._is_silent = True
        self._later(random.uniform(10.0, 30.0), partial(self._black_out, random))

    def _black_out(self, random: Random) -> None:
        """Have every machine lose power; the edge server is the last to return."""
        if not self._is_silent:
            return
        self._is_silent = False
        world = self._world
        paths = [*world.up.values(), *world.down.values()]
        for machine in self._machines:
            machine.lose_power()
        for path in paths:
            path.is_up = False

        def restore() -> None:
            for path in paths:
                path.is_up = True
            for system in world.vehicles:
                world.connected(system)

        self._later(random.uniform(2.0, 6.0), lambda: self._start(world.broker))
        self._later(random.uniform(2.0, 8.0), restore)
        for process in (world.relay, world.edge):
            self._powerless.add(process)
            return_s = random.uniform(*POWERLESS_S)
            world.scheduler.after(return_s, partial(self._return_power, process))

    def _return_power(self, process: Process) -> None:
        self._powerless.discard(process)
        self._start(process)

    def _accepted(self) -> None:
        """Have what was accepted just now be the last that was done."""
        pause_s = self._kills.expovariate(1.0 / MEAN_KILL_S)
        if self._is_silent:
            self._later(pause_s, partial(self._black_out, self._kills))
        elif Fault.BROKER_KILLED in self._enabled and self._kills.random() < KILL_RATE:
            kill = self._kill(Fault.BROKER_KILLED, self._world.broker)
            self._later(pause_s, lambda: kill(self._kills))

    def _lose_power(self, random: Random) -> None:
        """Have a machine lose power, perhaps in the middle of a commit, and return."""
        edge, broker = self._machines
        for machine in random.choice(((edge,), (broker,), (edge, broker))):
            changes = random.choice((0, random.randrange(1, 40)))
            machine.lose_power(partial(self._restart, machine, random), after_changes=changes)

    def _restart(self, machine: Machine, random: Random) -> None:
        for process in machine.processes:
            self._later(random.expovariate(1.0 / 5.0), partial(self._start, process))

    def _trouble_disk(self, begin: Callable[[Machine, Random], None]) -> Callable[[Random], None]:
        """Have a disk refuse, or take longer, for a while."""

        def trouble(random: Random) -> None:
            machine = random.choice(self._machines)
            begin(machine, random)
            self._later(random.expovariate(1.0 / 12.0), machine.restore)

        return trouble

    def _start(self, process: Process) -> None:
        if not process.is_up and process not in self._powerless:
            process.start()
            for system in self._world.vehicles:
                self._world.connected(system)

    def _kill(self, fault: Fault, process: Process) -> Callable[[Random], None]:
        def kill(random: Random) -> None:
            if not process.is_up:
                return
            self._world.scheduler.note("faults", fault.split("-")[0], "killed")
            process.kill()

            def start() -> None:
                if not process.is_up and process not in self._powerless:
                    self._world.scheduler.note("faults", fault.split("-")[0], "started")
                    self._start(process)

            self._later(random.expovariate(1.0 / 5.0), start)

        return kill
