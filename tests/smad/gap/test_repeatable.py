"""The same runs give the same answer whatever the program around a diagnosis has set."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from smad.gap import diagnose
from smad.gap.fit.threads import repeatable
from threadpoolctl import threadpool_info, threadpool_limits

from tests.smad.gap.cases import OTHER, SETTINGS, bank
from tests.smad.gap.heater_plant import HeaterPlant


def blas_threads() -> set[int]:
    return {p["num_threads"] for p in threadpool_info() if p["user_api"] == "blas"}


@contextmanager
def two_threads() -> Iterator[None]:
    with threadpool_limits(limits=2, user_api="blas"):
        if blas_threads() != {2}:
            pytest.skip("the BLAS of this numpy cannot be told how many threads to use")
        yield


def test_a_diagnosis_adds_in_one_order_and_leaves_the_callers_threads_as_they_were() -> None:
    seen: list[set[int]] = []
    with two_threads():
        diagnose(
            bank(OTHER)[:2],
            plant=HeaterPlant(),
            settings=SETTINGS,
            progress=lambda text: seen.append(blas_threads()),
        )
        assert blas_threads() == {2}
    assert len(seen) > 3
    assert all(threads == {1} for threads in seen)


def test_threads_come_back_when_the_work_fails() -> None:
    @repeatable
    def fails() -> None:
        assert blas_threads() == {1}
        raise ValueError

    with two_threads():
        with pytest.raises(ValueError):
            fails()
        assert blas_threads() == {2}
