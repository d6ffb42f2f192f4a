"""The command server's words: any bytes give a call or an error reply, never an exception."""

import json
from typing import Any

import msgspec
from hypothesis import given, settings
from hypothesis import strategies as st

from smad import api
from smad.api import METHODS
from smad.daemon.errors import Refusal
from smad.daemon.rpc import Call, Decoder, error_reply, result_reply

ALL = Decoder()
STOPS = Decoder("stop")

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=12), inner, max_size=4)
    ),
    max_leaves=12,
)
REQUESTS = st.fixed_dictionaries(
    {},
    optional={
        "jsonrpc": st.just("2.0") | JSON,
        "id": st.integers() | st.text(max_size=5) | JSON,
        "method": st.sampled_from([m.name for m in METHODS]) | st.text(max_size=10),
        "params": JSON
        | st.dictionaries(
            st.sampled_from(["trajectories", "i_x_A", "name", "value", "spring", "lease_s"]), JSON
        ),
    },
)


def judged(answer: Call | bytes) -> Any:
    if isinstance(answer, Call):
        return answer
    reply = json.loads(answer)
    assert reply["jsonrpc"] == "2.0"
    assert reply["error"]["message"]
    assert "\n" not in reply["error"]["message"]
    return reply


@settings(deadline=None, max_examples=400, derandomize=True)
@given(st.binary(max_size=300))
def test_any_bytes_give_an_answer(data: bytes) -> None:
    judged(ALL.decode(data))
    judged(STOPS.decode(data))


@settings(deadline=None, max_examples=600, derandomize=True)
@given(JSON | REQUESTS)
def test_any_json_gives_an_answer(value: Any) -> None:
    data = json.dumps(value).encode()
    judged(ALL.decode(data))
    judged(STOPS.decode(data))


def test_a_valid_request_becomes_a_typed_call() -> None:
    call = ALL.decode(b'{"jsonrpc":"2.0","id":3,"method":"params.get","params":{"name":"x"}}')
    assert isinstance(call, Call)
    assert call.params == api.GetParam(name="x")
    assert (call.id, call.wants_reply, call.method.name) == (3, True, "params.get")


def test_a_request_without_an_id_wants_no_reply() -> None:
    call = ALL.decode(b'{"jsonrpc":"2.0","method":"disarm"}')
    assert isinstance(call, Call)
    assert not call.wants_reply


def test_the_reply_to_a_refused_request_carries_its_id_code_and_value() -> None:
    reply = judged(ALL.decode(b'{"id":"a","method":"record.note","params":{"text":""}}'))
    assert reply["id"] == "a"
    assert reply["error"]["code"] == -32602
    assert reply["error"]["data"]["value"] == ""


def test_the_stop_channel_takes_stops_only() -> None:
    reply = judged(STOPS.decode(b'{"id":1,"method":"arm"}'))
    assert "stop commands only" in reply["error"]["message"]
    assert "disarm" in reply["error"]["data"]["limit"]
    assert isinstance(STOPS.decode(b'{"id":1,"method":"estop"}'), Call)


def test_nan_and_infinity_are_refused_as_json_and_as_numbers() -> None:
    for text in ("NaN", "Infinity", "1e999"):
        data = f'{{"id":1,"method":"params.set","params":{{"name":"a","value":{text}}}}}'
        assert judged(ALL.decode(data.encode()))["error"]["code"] in (-32700, -32602)


def test_deep_nesting_is_refused() -> None:
    judged(ALL.decode(b"[" * 60_000))
    judged(ALL.decode(b'{"method":"move","params":' + b'{"a":' * 10_000))


def test_a_batch_is_refused_with_a_hint() -> None:
    assert "not a batch" in judged(ALL.decode(b'[{"method":"status"}]'))["error"]["message"]


def test_replies_are_json_whatever_value_was_refused() -> None:
    refusal = Refusal(api.Reason.INVALID, "cause", value=object(), limit=range(3))
    assert json.loads(error_reply(1, refusal))["error"]["data"]["limit"] == "range(0, 3)"
    text = result_reply(None, api.ConfigText(toml="a = 1"))
    assert msgspec.json.decode(text) == {"jsonrpc": "2.0", "id": None, "result": {"toml": "a = 1"}}
