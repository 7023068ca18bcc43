"""Joints as data: what each holds, in rows that the dynamics know; no arithmetic here."""
