"""Runs made ready: admitted, laid out as rows on one grid and replayed, their noise floors."""
