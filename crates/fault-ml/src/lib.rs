//! Monitors that decide whether a channel is to be believed. Plain numbers in, verdicts out.
