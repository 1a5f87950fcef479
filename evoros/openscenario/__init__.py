"""Scenario files of OpenSCENARIO DSL, which the tool scenario_execution runs; optional."""
