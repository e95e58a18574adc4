"""Quiet ticks: those in which bodies only move and sense, for many worlds in one call of compiled code."""
