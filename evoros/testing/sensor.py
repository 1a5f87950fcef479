"""Conformance tests for sensor types."""

import math
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import numpy as np
from lxml import etree

from evoros.base.rng import generator
from evoros.compilation.rules import FILTER
from evoros.filter.protocol import Filter
from evoros.sensor.protocol import (
    CONTACT,
    RANGE,
    SENSOR_ARGUMENTS,
    SIGNAL_SIZES,
    Channel,
    ContactSensor,
    RangeSensor,
    Sensor,
    SignalSensor,
)
from evoros.testing.part import PartSuite
from evoros.testing.rules import RuleCase, RuleSuite


class SensorSuite(PartSuite):
    """Conformance tests shared by all sensor types."""

    part: Any
    protocol = Sensor
    simulated_by_gazebo: ClassVar[bool] = True  # False if ``gazebo`` returns ""

    def test_its_channels_have_names_and_limits(self) -> None:
        """There is at least one channel, and the minimum of each is below its maximum."""
        assert len(self.part.channels) > 0, "a sensor must have at least one channel"
        for channel in self.part.channels:
            assert isinstance(channel, Channel), f"{channel!r} must be a Channel"
            assert channel.name, f"{channel} must have a name, because columns are named after it"
            assert channel.low < channel.high, f"{channel} must have low < high"

    def test_its_body_period_and_price_are_possible(self) -> None:
        """Lengths, mass and period are positive, and the price is not negative."""
        part = self.part
        amounts = [*part.size_m, part.mass_kg, part.period_s]
        assert len(part.size_m) == 3, f"size_m must be three lengths, not {part.size_m}"
        possible = all(0 < amount < math.inf for amount in amounts)
        assert possible, f"size_m, mass_kg and period_s must be positive and finite, not {amounts}"
        assert 0 <= part.price < math.inf, f"price must be at least 0 and finite, not {part.price}"

    def test_its_filters_are_filters(self) -> None:
        """All entries of ``filters`` are filters."""
        for name, item in self.part.filters.items():
            assert isinstance(item, Filter), f"filters.{name} must be a filter, not {item!r}"

    def test_gazebo_is_told_of_it(self) -> None:
        """``gazebo`` returns a single ``<sensor>`` element with the given name."""
        text = self.part.gazebo("left_1")
        if not self.simulated_by_gazebo:
            assert text == "", f"gazebo must return an empty string, not {text!r}"
            return
        element = etree.fromstring(text)
        assert element.tag == "sensor", f"gazebo must return <sensor>, not {element.tag!r}"
        assert element.get("name") == "left_1", f"the element must have the given name: {text}"


class RangeSensorSuite(SensorSuite):
    """Conformance tests for a sensor that measures distances along rays."""

    part: RangeSensor
    protocol = RangeSensor

    def use(self, part: RangeSensor, seed: int) -> Iterator[Any]:
        """Compute all quantities used by simulators."""
        yield part.rays()
        yield part.channel_of(), tuple(part.channels)
        yield part.gazebo(f"sensor_{seed}")

    def test_its_range_is_possible(self) -> None:
        """The minimum is not negative and below the maximum, which is finite."""
        part, low, high = self.part, self.part.range_min_m, self.part.range_max_m
        assert part.measures == RANGE, f"measures must be {RANGE!r}, not {part.measures!r}"
        rule = "range_min_m must be at least 0 and below range_max_m, which must be finite"
        assert 0 <= low < high < math.inf, f"{rule}, but they are {low} and {high}"

    def test_its_rays_are_unit_vectors(self) -> None:
        """The rays are a float64 array (k, 3) of unit vectors."""
        rays = self.part.rays()
        assert rays.dtype == np.float64, f"rays must be float64, not {rays.dtype}"
        assert rays.shape == (len(rays), 3), f"rays must have shape (k, 3), not {rays.shape}"
        lengths = np.sqrt((rays * rays).sum(axis=1))
        assert np.allclose(lengths, 1.0, rtol=0, atol=1e-15), "rays must have length 1"

    def test_each_ray_has_a_channel_and_each_channel_a_ray(self) -> None:
        """``channel_of`` gives each ray the index of a channel, and each channel has a ray."""
        of, rays = self.part.channel_of(), len(self.part.rays())
        indices = set(range(len(self.part.channels)))
        assert of.shape == (rays,), f"channel_of must have shape ({rays},), not {of.shape}"
        assert of.dtype.kind == "i", f"channel_of must have an integer type, not {of.dtype}"
        assert set(of.tolist()) == indices, f"channel_of must contain each index in {indices}"


class SignalSensorSuite(SensorSuite, RuleSuite):
    """Conformance tests for a sensor that computes its readings from a simulated signal."""

    part: SignalSensor
    protocol = SignalSensor
    signature: ClassVar[Any] = FILTER
    fills = "values"

    def start_rules(self, part: SignalSensor, seed: int) -> Sequence[RuleCase]:
        """Start the rule."""
        lengths = {"signal": SIGNAL_SIZES[part.measures], "values": len(part.channels)}
        return [RuleCase(part.rule, SENSOR_ARGUMENTS, part.start(), lengths)]

    def test_its_signal_exists(self) -> None:
        """The sensor measures a signal provided by simulators."""
        measures, known = self.part.measures, ", ".join(SIGNAL_SIZES)
        assert measures in SIGNAL_SIZES, f"measures must be one of {known}, not {measures!r}"

    def test_its_readings_are_finite(self) -> None:
        """The rule fills all channels with finite values, at rest and in motion."""
        for scale in (0.0, 1.0):
            (case,) = self.start_rules(self.part, 0)
            rule, inputs, rng = case.bind(), np.random.default_rng(0), generator("", "")
            for tick in range(5):
                given = case.draw(inputs, rng, 0.1 * tick)
                given["values"][:] = np.nan
                given["signal"] *= scale
                rule(*given.values())
                assert np.isfinite(given["values"]).all(), f"readings are {given['values']}"


class ContactSensorSuite(SignalSensorSuite):
    """Conformance tests for a sensor that detects contacts of the robot in a zone."""

    part: ContactSensor
    protocol = ContactSensor

    def test_its_zone_is_possible(self) -> None:
        """The zone has a positive width, and begins at or behind the mount."""
        part, width, depth = self.part, self.part.width_m, self.part.depth_m
        assert part.measures == CONTACT, f"measures must be {CONTACT!r}, not {part.measures!r}"
        assert 0 < width < math.inf, f"width_m must be positive and finite, not {width}"
        assert 0 <= depth < math.inf, f"depth_m must be at least 0 and finite, not {depth}"
