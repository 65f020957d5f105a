# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who may enter our server: nobody by name unless tokens are given; then roles as on the page."""

from contextvars import ContextVar
from dataclasses import dataclass

from asyncua import ua
from asyncua.crypto.permission_rules import SimpleRoleRuleset, User, UserRole
from asyncua.server.internal_server import InternalServer
from asyncua.server.user_managers import UserManager
from damadics_fd.store.access import Access, Role


@dataclass
class Person(User):
    """A user of our server; nobody is its administrator, so that no node can be written."""

    may_operate: bool = False


caller: ContextVar[User | None] = ContextVar('caller', default=None)


class Doorman(UserManager):
    """
    Lets users in: the password of a user is a token.

    :param access: the tokens; without any, everybody may see and nobody may act.
    """

    def __init__(self, access: Access) -> None:
        self._access = access

    def get_user(
        self,
        iserver: InternalServer,
        username: str | None = None,
        password: str | None = None,
        certificate: object = None,
    ) -> User | None:
        """Return what a user may do; None: the user is refused."""
        if self._access.open:
            return Person(UserRole.User)
        grant = self._access.of(password or '')
        if grant is None:
            return None
        return Person(UserRole.User, grant.name or username, grant.role is Role.OPERATOR)


class Rules(SimpleRoleRuleset):
    """Remember who asks, for the methods, which ask for the role."""

    def check_validity(self, user: User, action_type_id: ua.NodeId, body: object) -> bool:
        """Tell whether a request is let through."""
        caller.set(user)
        return bool(super().check_validity(user, action_type_id, body))  # type: ignore[no-untyped-call]


def operator() -> User | None:
    """Return who calls, if it is an operator."""
    user = caller.get()
    return user if isinstance(user, Person) and user.may_operate else None
