# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The HTTP interface: what can be asked for and what can be done."""

from typing import Annotated

from damadics_fd.core.text import COMMENT, NAME
from damadics_fd.store.access import Grant
from damadics_fd.web.limits import SizeLimit
from fastapi import Depends, FastAPI, HTTPException, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, JSONResponse, StreamingResponse
from pydantic import BaseModel, ConfigDict, Field

from damadics_connect.actions import LONGEST_SHELF, Actions
from damadics_connect.http.docs_page import docs_page
from damadics_connect.http.guard import Guard
from damadics_connect.http.metrics import exposition
from damadics_connect.http.stream import Stream
from damadics_connect.judgement import Plain, as_json
from damadics_connect.watch import Watch

LARGEST = 10_000  # bytes of a request
ALARMS = ('alarm', 'latched', 'shelved', 'unknown')
Row = dict[str, Plain]


class Body(BaseModel):
    """What an action may say; nothing else is taken."""

    model_config = ConfigDict(extra='forbid', strict=True)
    user: str = Field('', max_length=NAME, description='who; else the name of the token')
    comment: str = Field('', max_length=COMMENT, description='why')


class AcknowledgeBody(Body):
    """Which alarm was seen."""

    occurrence: int = Field(0, ge=0, lt=2**32, description='number of the alarm, 0: the present')


class ShelveBody(Body):
    """For how long."""

    duration: float = Field(..., ge=0.0, le=LONGEST_SHELF, description='[s]; 0: end it now')


class PartialStrokeBody(Body):
    """How many strokes, and how large."""

    amplitude: float = Field(0.0, ge=0.0, le=1.0, description='to each side, share of full travel')
    count: int = Field(..., ge=0, lt=2**32, description='number of strokes; 0: end them now')


def application(watch: Watch, actions: Actions, stream: Stream, guard: Guard) -> FastAPI:
    """
    Make the application.

    :param watch: what is known of the valves.
    :param actions: does what is asked for.
    :param stream: tells changes.
    :param guard: who may do what.
    :return: an ASGI application.
    """
    app = FastAPI(
        title='DAMADICS FD',
        summary='Judgements of control valves. Advisory only.',
        description='Stamps are nanoseconds; what is not known is null; silence is not health: '
        'a valve whose state is not_monitored is not judged.',
        docs_url=None,  # those of the library load their scripts from other machines
        redoc_url=None,
    )
    viewer = Depends(guard.viewer)
    operator = Annotated[Grant, Depends(guard.operator)]

    app.add_middleware(SizeLimit, upload=LARGEST, request=LARGEST, remedy='see /docs')

    @app.exception_handler(RequestValidationError)
    async def refuse(request: Request, problem: RequestValidationError) -> Response:
        # not the standard answer, which repeats what came in and cannot write every number
        wrong = [
            f'{".".join(str(part) for part in error["loc"][1:])[:NAME]}: {error["msg"][:COMMENT]}'
            for error in problem.errors()[:5]
        ]
        return JSONResponse({'detail': '; '.join(wrong)}, 422)

    @app.get('/docs', include_in_schema=False)
    def docs() -> HTMLResponse:
        return HTMLResponse(docs_page(app.openapi()))

    @app.get('/api/fleet', dependencies=[viewer])
    def fleet() -> list[Row]:
        """Judgement of every valve."""
        return [as_json(judgement) for _, judgement in sorted(watch.valves.items())]

    @app.get('/api/valves/{valve:path}', dependencies=[viewer])
    def valve_of(valve: str) -> Row:
        """Judgement of one valve."""
        if valve not in watch.valves:
            raise HTTPException(404, 'there is no such valve: see /api/fleet')
        return as_json(watch.valves[valve])

    @app.get('/api/alarms', dependencies=[viewer])
    def alarms() -> list[Row]:
        """Valves whose alarm is present, latched, shelved or lost."""
        return [
            as_json(judgement)
            for _, judgement in sorted(watch.valves.items())
            if judgement.state in ALARMS or judgement.fault
        ]

    @app.get('/api/history', dependencies=[viewer])
    def history(
        valve: Annotated[str, Query(max_length=NAME)] = '',
        since: Annotated[int, Query(ge=0, description='[ns]')] = 0,
        limit: Annotated[int, Query(ge=1, le=10_000)] = 100,
    ) -> list[Row]:
        """Transitions, the newest first."""
        found = (
            event
            for event in reversed(list(watch.events))
            if event.stamp >= since and valve in ('', event.valve)
        )
        return [as_json(event) for event, _ in zip(found, range(limit), strict=False)]

    @app.get('/api/events', dependencies=[viewer])
    def events(request: Request) -> StreamingResponse:
        """Send changes as server-sent events: `valve` (judgement), `event` (transition)."""
        last = request.headers.get('last-event-id', '')
        after = int(last) if last.isdigit() and len(last) < 19 else None
        return StreamingResponse(
            stream.listen(after),
            media_type='text/event-stream',
            headers={'Cache-Control': 'no-store', 'X-Accel-Buffering': 'no'},
        )

    async def done(
        action: str,
        valve: str,
        grant: Grant,
        body: Body,
        *,
        occurrence: int = 0,
        duration: float = 0.0,
        strokes: tuple[float, int] = (0.0, 0),
    ) -> Response:
        if valve not in watch.valves:
            raise HTTPException(404, 'there is no such valve: see /api/fleet')
        user = grant.name or body.user or grant.role
        answer = await actions.do(
            action,
            valve,
            user,
            body.comment,
            occurrence=occurrence,
            duration=duration,
            amplitude=strokes[0],
            count=strokes[1],
        )
        return JSONResponse(
            {'done': answer.done, 'text': answer.text}, 200 if answer.done else 409
        )

    @app.post('/api/acknowledge/{valve:path}')
    async def acknowledge(valve: str, body: AcknowledgeBody, grant: operator) -> Response:
        """Note that a person has seen the alarm."""
        return await done('acknowledge', valve, grant, body, occurrence=body.occurrence)

    @app.post('/api/reset/{valve:path}')
    async def reset(valve: str, body: Body, grant: operator) -> Response:
        """Release the latch of an alarm whose condition has gone."""
        return await done('reset', valve, grant, body)

    @app.post('/api/shelve/{valve:path}')
    async def shelve(valve: str, body: ShelveBody, grant: operator) -> Response:
        """Mask the alarms of a valve for a time."""
        return await done('shelve', valve, grant, body, duration=body.duration)

    @app.post('/api/partial_stroke/{valve:path}')
    async def partial_stroke(valve: str, body: PartialStrokeBody, grant: operator) -> Response:
        """Ask the driver of a valve for small strokes, where its detector allows them."""
        asked = body.amplitude, body.count
        return await done('partial_stroke', valve, grant, body, strokes=asked)

    @app.get('/metrics', dependencies=[viewer])
    def metrics() -> Response:
        """Metrics for Prometheus."""
        text, kind = exposition(watch)
        return Response(text, media_type=kind)

    return app
