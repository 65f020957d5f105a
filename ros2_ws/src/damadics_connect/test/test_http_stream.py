# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a listener on the event stream is told, whenever it comes."""

import asyncio
import json
from collections.abc import AsyncIterator

from damadics_connect.http import stream
from damadics_connect.judgement import Judgement


async def until_alive(source: stream.Stream, after: int | None = None) -> AsyncIterator[str]:
    """Yield what a listener gets that has just come."""
    async for text in source.listen(after):
        if text.startswith(': alive'):
            return
        yield text


async def heard(source: stream.Stream, after: int | None) -> list[tuple[int, str, str]]:
    """Return number, valve and state of what a listener gets that has just come."""
    await asyncio.sleep(0.0)  # what was told is spread
    found = []
    async for text in until_alive(source, after):
        fields = dict(line.split(': ', 1) for line in text.strip().splitlines())
        if 'data' in fields:
            data = json.loads(fields['data'])
            found.append((int(fields['id']), data['valve'], data['state']))
    return found


class Source(stream.Stream):
    """A stream with the valves that it tells of, as the watch has them."""

    def __init__(self) -> None:
        self.valves: dict[str, Judgement] = {}
        super().__init__(asyncio.get_running_loop(), self.valves)

    def change(self, valve: str, state: str) -> None:
        self.valves[valve] = Judgement(valve, state=state)
        self.state(self.valves[valve])


def told(scenario, monkeypatch) -> None:
    monkeypatch.setattr(stream, 'BEAT', 0.05)

    async def run() -> None:
        await scenario(Source())

    asyncio.run(run())


def test_who_comes_first_is_told_the_present_state_of_every_valve(monkeypatch):
    async def scenario(source: Source) -> None:
        for valve, state in (('lv1', 'healthy'), ('lv2', 'healthy'), ('lv1', 'alarm')):
            source.change(valve, state)
        found = await heard(source, None)
        assert [words[1:] for words in found] == [('lv2', 'healthy'), ('lv1', 'alarm')]
        assert await heard(source, found[-1][0]) == [], 'it has them all'

    told(scenario, monkeypatch)


def test_the_present_state_has_the_numbers_of_now(monkeypatch):
    async def scenario(source: Source) -> None:
        source.change('lv1', 'healthy')
        source.valves['lv1'] = Judgement('lv1', state='healthy', stamp=7)
        await asyncio.sleep(0.0)
        first = [text async for text in until_alive(source)]
        assert '"stamp": 7' in first[1]

    told(scenario, monkeypatch)


def test_who_was_away_for_longer_than_is_kept_knows_the_present_state(monkeypatch):
    async def scenario(source: Source) -> None:
        source.change('lv1', 'healthy')
        first = (await heard(source, None))[0][0]
        source.change('lv1', 'latched')
        for n in range(stream.KEPT + 1):
            source.change('lv2', ('healthy', 'alarm')[n % 2])
        found = await heard(source, first)
        assert found[0] == (first + 1, 'lv1', 'latched')
        numbers = [number for number, *_ in found]
        assert numbers == sorted(set(numbers)) and len(numbers) == stream.KEPT + 1

    told(scenario, monkeypatch)
