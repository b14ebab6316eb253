"""The tables of a store; docs/fleet.md tells what each column holds."""

VERSION = "1"
TABLES = """
CREATE TABLE about (key VARCHAR PRIMARY KEY, value VARCHAR NOT NULL);
CREATE TABLE machines (machine VARCHAR PRIMARY KEY, kind VARCHAR NOT NULL, drawing VARCHAR NOT NULL, added TIMESTAMP);
CREATE TABLE runs (
    run VARCHAR PRIMARY KEY, machine VARCHAR NOT NULL, date TIMESTAMP NOT NULL, place BIGINT NOT NULL,
    file VARCHAR NOT NULL, kept VARCHAR NOT NULL, readings VARCHAR NOT NULL, row_count BIGINT NOT NULL,
    ordered BOOLEAN NOT NULL, units_said BOOLEAN NOT NULL, added TIMESTAMP);
CREATE TABLE claims (machine VARCHAR PRIMARY KEY, owner VARCHAR NOT NULL, since TIMESTAMP);
CREATE TABLE programs (
    program VARCHAR PRIMARY KEY, version VARCHAR, python VARCHAR, torch VARCHAR, numpy VARCHAR, scipy VARCHAR);
CREATE TABLE outcomes (
    run VARCHAR PRIMARY KEY, machine VARCHAR NOT NULL, did VARCHAR NOT NULL, verdict VARCHAR NOT NULL,
    error_um DOUBLE, expected_um DOUBLE, noise_um DOUBLE, words VARCHAR, seconds DOUBLE, program VARCHAR,
    finished TIMESTAMP);
CREATE TABLE checks (run VARCHAR PRIMARY KEY, ok BOOLEAN, result JSON);
CREATE TABLE diagnoses (run VARCHAR PRIMARY KEY, verdict VARCHAR, result JSON);
CREATE TABLE rechecks (run VARCHAR PRIMARY KEY, verdict VARCHAR, result JSON);
CREATE TABLE parameters (
    run VARCHAR, machine VARCHAR NOT NULL, effect VARCHAR NOT NULL, parameter VARCHAR NOT NULL, label VARCHAR,
    unit VARCHAR, value DOUBLE, std DOUBLE, usual DOUBLE, PRIMARY KEY (run, effect, parameter));
CREATE TABLE fits (
    run VARCHAR PRIMARY KEY, names VARCHAR[], labels VARCHAR[], usual DOUBLE[], information DOUBLE[], score DOUBLE[],
    units VARCHAR[]);
CREATE TABLE models (
    machine VARCHAR NOT NULL, run VARCHAR NOT NULL, made VARCHAR NOT NULL, toml VARCHAR NOT NULL, since TIMESTAMP,
    PRIMARY KEY (machine, run, made));
"""
