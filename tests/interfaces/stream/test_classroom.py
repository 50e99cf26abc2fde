"""A class at one robot: who comes in by a code, who is here, and who has control next."""

from random import Random

import pytest

from interfaces.messages import Order, control
from interfaces.messages.control import (
    Acquire,
    GiveControl,
    ProblemCode,
    Release,
    RequestControl,
    Role,
    TakeOver,
    Who,
    Withdraw,
)
from interfaces.stream.codec import Encoding, News, decode, encode
from interfaces.stream.invitations import GRACE, LESSON, RENEWED, Invitations
from interfaces.stream.leasing import LONGEST_NAME, OFFERED, cleaned
from robots.onboard.lease import LeaseEnd, LeaseState
from tests.interfaces.joined import to
from tests.interfaces.stream.served import ADMIN, make_hub
from tests.interfaces.stream.test_session import COMING


class Pupil:
    """A client by a plain protocol: what it was told last of the lease, and of who is here."""

    def __init__(self, room, *, name="Ada", role=Role.OPERATOR, token=None, session=None, address="", now=0.0):
        self.hub, self.now = room, now
        self.session = room.open(Encoding.JSON, now=now, address=address)
        self.lease = self.present = self.welcome = self.problem = None
        self.number = 0
        self.tell(control.Hello(control.PROTOCOL, role, name, token, session), now=now)

    def tell(self, message, *, now):
        self.session.receive(encode(message, Encoding.JSON).decode(), now=now)
        return self.look(now=now)

    def ask(self, kind, *fields, now):
        """Ask something; its answer."""
        self.number += 1
        found = self.tell(kind(self.number, *fields), now=now)
        return next(m for m in found if self.number in (getattr(m, "answers", None), getattr(m, "number", None)))

    def look(self, *, now):
        self.hub.advance(now=now)
        found = []
        while batch := self.session.advance(now=now):
            found += [decode(data, Encoding.JSON, allowed=COMING | News) for data in batch]
        for message in found:
            match message:
                case control.Welcome():
                    self.welcome, self.lease = message, message.lease
                case control.Lease():
                    self.lease = message
                case control.Present():
                    self.present = message
                case control.Problem():
                    self.problem = message
        return found

    def leave(self, *, now, done=True):
        self.hub.leave(self.session, done=done, now=now)


class Lesson:
    """A hub with a class."""

    def __init__(self, **options):
        self.invitations = Invitations(0.0)
        self.hub = make_hub(invitations=self.invitations, **options)

    def code(self, role=Role.OPERATOR, *, now=0.0):
        return next(one.code for one in self.invitations.shown(now=now) if one.role is role)

    def pupil(self, name="Ada", role=Role.OPERATOR, *, now=0.0, **options):
        return Pupil(self.hub, name=name, token=self.code(role, now=now), now=now, **options)

    def teacher(self, *, now=0.0):
        return Pupil(self.hub, name="Teacher", role=Role.ADMIN, token=ADMIN, now=now)


def told(*pupils, now):
    """What each is told of the lease: whether it has it, its place, whether it's offered."""
    for pupil in pupils:
        pupil.look(now=now)
    return [
        "has it" if one.lease.yours else "offered" if one.lease.offered_until is not None else one.lease.waiting
        for one in pupils
    ]


# Coming in.


@pytest.mark.parametrize(
    ("code", "asked", "got"),
    [
        (Role.OPERATOR, Role.OPERATOR, Role.OPERATOR),
        (Role.OPERATOR, Role.VIEWER, Role.VIEWER),
        (Role.OPERATOR, Role.ADMIN, Role.OPERATOR),
        (Role.OPERATOR, Role.SITE, Role.OPERATOR),
        (Role.VIEWER, Role.OPERATOR, Role.VIEWER),
        (Role.VIEWER, Role.VIEWER, Role.VIEWER),
        (Role.VIEWER, Role.ADMIN, Role.VIEWER),
    ],
)
def test_a_code_gives_its_role_and_no_more(code, asked, got):
    lesson = Lesson()
    assert Pupil(lesson.hub, role=asked, token=lesson.code(code)).welcome.role is got


def test_nobody_comes_in_without_a_code_or_a_token():
    lesson = Lesson()
    for token in (None, "AAAAAA", "AAAAAAA", "b" * 43):
        for role in (Role.VIEWER, Role.OPERATOR, Role.ADMIN):
            pupil = Pupil(lesson.hub, role=role, token=token)
            assert pupil.problem.code is ProblemCode.REFUSED
            assert pupil.session.closing[0] == 1008
    assert lesson.hub.seats == 0
    assert lesson.teacher().welcome.role is Role.ADMIN


def test_too_many_tries_wait_and_take_nothing_from_others():
    lesson = Lesson()
    found = [Pupil(lesson.hub, token="AAAAAA", address="guesser").problem.code for _ in range(80)]
    assert found == [ProblemCode.REFUSED] * 60 + [ProblemCode.TOO_FAST] * 20
    right = Pupil(lesson.hub, token=lesson.code(), address="guesser")
    assert (right.problem.code, right.session.closing[0]) == (ProblemCode.TOO_FAST, 1013)
    assert Pupil(lesson.hub, token=lesson.code(), address="school").welcome.role is Role.OPERATOR
    assert Pupil(lesson.hub, token=lesson.code(), address="guesser", now=2.1).welcome.role is Role.OPERATOR


def test_who_came_in_by_a_code_goes_on_without_one():
    lesson = Lesson()
    first, code = lesson.pupil(), lesson.code()
    later = RENEWED + GRACE + 1.0
    late = Pupil(lesson.hub, token=code, now=later)
    assert late.problem.code is ProblemCode.REFUSED
    late.leave(now=later)
    first.leave(now=later)
    for token in (None, code, first.welcome.session):
        again = Pupil(lesson.hub, token=token, session=first.welcome.session, now=later + 1.0)
        assert (again.welcome.resumed, again.welcome.role) == (True, Role.OPERATOR)
        again.leave(now=later + 1.0)
    forgotten = later + 100.0
    lesson.hub.advance(now=forgotten)
    new = Pupil(lesson.hub, session=first.welcome.session, now=forgotten)
    assert (new.welcome.resumed, new.welcome.role) == (False, Role.OPERATOR)
    assert new.welcome.session != first.welcome.session
    new.leave(now=forgotten)
    lesson.code(now=LESSON + RENEWED)
    last = Pupil(lesson.hub, session=new.welcome.session, now=LESSON + RENEWED)
    assert last.problem.code is ProblemCode.REFUSED


def test_a_viewer_may_become_an_operator_by_the_other_code():
    lesson = Lesson()
    viewer = lesson.pupil(role=Role.VIEWER)
    session = viewer.welcome.session
    assert Pupil(lesson.hub, session=session).welcome.role is Role.VIEWER
    assert Pupil(lesson.hub, session=session, token=lesson.code()).welcome.role is Role.OPERATOR
    assert Pupil(lesson.hub, session=session, token="AAAAAA").welcome.role is Role.VIEWER


@pytest.mark.parametrize(
    ("given", "seen"),
    [
        ("Ada", "Ada"),
        ("  Ada \n\t Lovelace ", "Ada Lovelace"),
        ("\u202eadA", "adA"),
        ("A\u200bd\u200da", "Ada"),
        ("\x1b[31mAda", "[31mAda"),
        ("Ａｄａ", "Ada"),
        ("\u200b", "Guest"),
        ("<b>Ada</b>", "<b>Ada</b>"),
        ("A" * 100, "A" * LONGEST_NAME),
        ("Zoë Ω 李", "Zoë Ω 李"),
    ],
)
def test_names_are_cleaned(given, seen):
    assert cleaned(given) == seen


def test_no_two_have_one_name():
    lesson = Lesson()
    pupils = [lesson.pupil(name) for name in ("Ada", "ADA", "ada", "Ada 2", "A" * 24, "A" * 30)]
    pupils[0].tell(Who(1), now=1.0)
    assert [member.name for member in pupils[0].present.members] == [
        "Ada", "ADA 2", "ada 3", "Ada 2 2", "A" * 24, "A" * 22 + " 2",
    ]  # fmt: skip


# Who is here.


def test_who_is_here_is_told_to_who_asks_and_when_it_changes():
    lesson = Lesson()
    ada, bo = lesson.pupil("Ada"), lesson.pupil("Bo", Role.VIEWER)
    answer = ada.ask(Who, now=1.0)
    assert [(m.number, m.name, m.role, m.waiting) for m in answer.members] == [
        (1, "Ada", Role.OPERATOR, 0), (2, "Bo", Role.VIEWER, 0),
    ]  # fmt: skip
    assert (answer.holder, answer.offered, answer.others) == (0, 0, 0)
    assert ada.lease.member == 1
    assert [m for m in ada.look(now=1.5) if m.kind == "present"] == [], "nothing has changed"
    ada.ask(RequestControl, now=2.0)
    ada.look(now=2.3)
    assert ada.present.holder == 1
    bo.leave(now=3.0)
    ada.look(now=3.3)
    assert [member.name for member in ada.present.members] == ["Ada"]
    assert bo.present is None, "it hasn't asked"


def test_a_list_of_many_is_bounded_and_not_told_too_often():
    lesson = Lesson()
    teacher = lesson.teacher()
    teacher.ask(Who, now=0.0)
    count = 0
    for k in range(150):
        lesson.pupil(f"pupil {k}", Role.VIEWER, address=str(k), now=2.0 * k)
    for k in range(100):
        teacher.look(now=300.0 + 0.01 * k)
        lesson.pupil("late", Role.VIEWER, address=f"late {k}", now=300.0 + 0.01 * k).leave(now=300.0 + 0.01 * k)
        count += sum(m.kind == "present" for m in teacher.look(now=300.0 + 0.01 * k))
    teacher.look(now=302.0)
    assert count <= 6
    assert (len(teacher.present.members), teacher.present.others) == (100, 51)
    assert len(encode(teacher.present, Encoding.JSON)) < 16_384


# Who has control next.


def test_a_free_one_is_had_at_once():
    lesson = Lesson()
    ada = lesson.pupil()
    answer = ada.ask(RequestControl, now=0.5)
    assert (answer.yours, answer.waiting, answer.offered_until) == (True, 0, None)
    assert ada.ask(RequestControl, now=0.6).yours, "who has it is told so again"
    order = ada.tell(Order(1, to(1), answer.epoch), now=0.7)
    assert next(m for m in order if m.kind == "outcome").refusal == ""


def test_who_asks_waits_in_order_and_is_offered_it():
    lesson = Lesson()
    ada, bo, cy = (lesson.pupil(name) for name in ("Ada", "Bo", "Cy"))
    epoch = ada.ask(RequestControl, now=0.1).epoch
    assert bo.ask(RequestControl, now=0.2).waiting == 1
    assert cy.ask(RequestControl, now=0.3).waiting == 2
    assert bo.ask(RequestControl, now=0.3).waiting == 1, "asking again changes nothing"
    ada.ask(Release, epoch, now=0.5)
    assert told(ada, bo, cy, now=0.5) == [0, "offered", 2]
    assert bo.lease.offered_until == 0.5 + OFFERED
    assert lesson.hub.lease_state is LeaseState.FREE
    for other in (ada, cy):
        refused = other.ask(Acquire, now=0.6)
        assert (refused.code, "Bo" in refused.text) == (ProblemCode.LEASE, True)
    assert ada.ask(RequestControl, now=0.6).waiting == 3
    assert bo.ask(Acquire, now=0.7).yours
    assert told(ada, bo, cy, now=0.8) == [2, "has it", 1]


def test_no_turn_runs_out_before_the_robot_is_met():
    lesson = Lesson()
    ada, bo, cy = (lesson.pupil(name) for name in ("Ada", "Bo", "Cy"))
    epoch = ada.ask(RequestControl, now=0.1).epoch
    bo.ask(RequestControl, now=0.2)
    cy.ask(RequestControl, now=0.3)
    lesson.hub.robot.met = False
    ada.ask(Release, epoch, now=0.5)
    for now in (1.0, 5.0, 50.0):
        assert told(bo, cy, now=now) == ["offered", 2]
    lesson.hub.robot.met = True
    assert told(bo, cy, now=60.0) == ["offered", 2]
    assert bo.lease.offered_until == 60.0 + OFFERED
    assert told(bo, cy, now=60.0 + OFFERED) == [0, "offered"]


def test_nobody_has_it_who_has_not_asked_again():
    lesson = Lesson()
    ada, bo = lesson.pupil("Ada"), lesson.pupil("Bo")
    epoch = ada.ask(RequestControl, now=0.1).epoch
    bo.ask(RequestControl, now=0.2)
    ada.ask(Release, epoch, now=0.3)
    assert lesson.hub.robot.log[-1][0] == "ended"


@pytest.mark.parametrize("how", ["by a second request", "by acquiring it"])
def test_an_offer_is_taken(how):
    lesson = Lesson()
    ada, bo = lesson.pupil("Ada"), lesson.pupil("Bo")
    epoch = ada.ask(RequestControl, now=0.1).epoch
    bo.ask(RequestControl, now=0.2)
    ada.ask(Release, epoch, now=0.3)
    assert bo.ask(RequestControl if "second" in how else Acquire, now=0.4).yours


def test_an_offer_passes_in_time():
    lesson = Lesson()
    ada, bo, cy = (lesson.pupil(name) for name in ("Ada", "Bo", "Cy"))
    ada.ask(RequestControl, now=0.0)
    bo.ask(RequestControl, now=0.0)
    cy.ask(RequestControl, now=0.0)
    end = 2.0
    assert told(ada, bo, cy, now=end) == [0, "offered", 2], "without beats it has run out"
    assert told(bo, cy, now=end + OFFERED - 0.01) == ["offered", 2]
    assert told(bo, cy, now=end + OFFERED) == [0, "offered"]
    assert bo.ask(Acquire, now=end + OFFERED).code is ProblemCode.LEASE
    assert told(bo, cy, now=end + 2 * OFFERED) == [0, 0]
    assert bo.ask(Acquire, now=end + 2 * OFFERED).yours, "nobody waits any more"


def test_who_is_away_keeps_the_place_and_blocks_nobody():
    lesson = Lesson()
    ada, bo, cy = (lesson.pupil(name) for name in ("Ada", "Bo", "Cy"))
    epoch = ada.ask(RequestControl, now=0.1).epoch
    bo.ask(RequestControl, now=0.2)
    cy.ask(RequestControl, now=0.2)
    bo.leave(now=0.3)
    assert told(cy, now=0.4) == [1]
    ada.ask(Release, epoch, now=0.5)
    assert told(cy, now=0.5) == ["offered"]
    bo = Pupil(lesson.hub, session=bo.welcome.session, now=0.6)
    assert bo.welcome.resumed
    assert told(bo, cy, now=0.6) == [1, "offered"]
    assert cy.ask(Withdraw, now=0.7).waiting == 0
    assert told(bo, cy, now=0.7) == ["offered", 0]
    bo.leave(now=0.8)
    lesson.hub.advance(now=0.9)
    lesson.hub.advance(now=40.0)
    assert told(cy, now=40.0) == [0]
    assert cy.ask(Acquire, now=40.0).yours


def test_an_offer_to_one_who_goes_is_the_next_ones():
    lesson = Lesson()
    ada, bo, cy = (lesson.pupil(name) for name in ("Ada", "Bo", "Cy"))
    epoch = ada.ask(RequestControl, now=0.1).epoch
    bo.ask(RequestControl, now=0.2)
    cy.ask(RequestControl, now=0.2)
    ada.ask(Release, epoch, now=0.3)
    assert told(bo, cy, now=0.3) == ["offered", 2]
    bo.leave(now=0.4, done=False)
    assert told(cy, now=0.4) == ["offered"]


def test_whoever_withdraws_moves_the_others_up():
    lesson = Lesson()
    pupils = [lesson.pupil(name) for name in ("Ada", "Bo", "Cy")]
    for pupil in pupils:
        pupil.ask(RequestControl, now=0.1)
    assert pupils[1].ask(Withdraw, now=0.2).waiting == 0
    assert told(*pupils, now=0.2) == ["has it", 0, 1]
    assert pupils[1].ask(Withdraw, now=0.3).waiting == 0, "once more changes nothing"
    refused = pupils[1].ask(Withdraw, 3, now=0.3)
    assert (refused.code, "admin" in refused.text) == (ProblemCode.LEASE, True)


# The teacher.


def test_the_teacher_takes_over_and_gives_back():
    lesson = Lesson()
    ada, bo, teacher = lesson.pupil("Ada"), lesson.pupil("Bo"), lesson.teacher()
    ada.ask(RequestControl, now=0.1)
    bo.ask(RequestControl, now=0.2)
    teacher.ask(TakeOver, now=0.3)
    assert told(ada, bo, teacher, now=0.3) == [0, 1, "has it"]
    assert ada.lease.ended is LeaseEnd.TAKEN_OVER
    teacher.ask(Release, teacher.lease.epoch, now=0.5)
    assert told(bo, teacher, now=0.5) == ["offered", 0]
    assert teacher.ask(Acquire, now=0.6).yours, "a teacher waits for no offer"
    assert told(bo, now=0.7) == [1]


def test_the_teacher_gives_control_to_a_named_one():
    lesson = Lesson()
    ada, bo, cy, di = (lesson.pupil(name) for name in ("Ada", "Bo", "Cy", "Di"))
    teacher = lesson.teacher()
    for pupil in (ada, bo, cy):
        pupil.ask(RequestControl, now=0.1)
    assert not teacher.ask(GiveControl, di.lease.member, now=0.2).yours
    assert told(ada, bo, cy, di, now=0.2) == [0, 2, 3, "offered"]
    assert ada.lease.ended is LeaseEnd.TAKEN_OVER
    teacher.ask(GiveControl, cy.lease.member, now=0.3)
    assert told(bo, cy, di, now=0.3) == [3, "offered", 2]
    assert cy.ask(Acquire, now=0.4).yours
    teacher.ask(GiveControl, cy.lease.member, now=0.5)
    assert told(bo, cy, di, now=0.5) == [2, "has it", 1], "it has it already"


def test_the_teacher_gives_it_while_the_robot_comes_to_rest():
    lesson = Lesson(stops=False)
    ada, bo, teacher = lesson.pupil("Ada"), lesson.pupil("Bo"), lesson.teacher()
    ada.ask(RequestControl, now=0.1)
    teacher.ask(TakeOver, now=0.2)
    teacher.ask(GiveControl, bo.lease.member, now=0.3)
    assert told(ada, bo, teacher, now=0.4) == [0, 1, 0]
    lesson.hub.stopped(now=0.5)
    assert told(ada, bo, teacher, now=0.5) == [0, "offered", 0]


def test_the_teacher_takes_somebody_out_of_the_queue():
    lesson = Lesson()
    ada, bo, cy, teacher = lesson.pupil("Ada"), lesson.pupil("Bo"), lesson.pupil("Cy"), lesson.teacher()
    for pupil in (ada, bo, cy):
        pupil.ask(RequestControl, now=0.1)
    teacher.ask(Withdraw, bo.lease.member, now=0.2)
    assert told(ada, bo, cy, now=0.2) == ["has it", 0, 1]
    assert teacher.ask(Withdraw, bo.lease.member, now=0.3).code is ProblemCode.LEASE


@pytest.mark.parametrize(
    ("who", "message", "code"),
    [
        (Role.VIEWER, RequestControl(9), ProblemCode.NOT_ALLOWED),
        (Role.VIEWER, Withdraw(9), ProblemCode.NOT_ALLOWED),
        (Role.VIEWER, GiveControl(9, 1), ProblemCode.NOT_ALLOWED),
        (Role.OPERATOR, GiveControl(9, 1), ProblemCode.LEASE),
        (Role.ADMIN, GiveControl(9, 1), ProblemCode.LEASE),
        (Role.ADMIN, GiveControl(9, 99), ProblemCode.LEASE),
        (Role.ADMIN, Withdraw(9, 99), ProblemCode.LEASE),
    ],
)
def test_who_may_ask_what(who, message, code):
    lesson = Lesson()
    lesson.pupil("watches", Role.VIEWER)
    pupil = lesson.teacher() if who is Role.ADMIN else lesson.pupil("asks", who)
    version = lesson.hub.leasing.version
    pupil.tell(message, now=0.1)
    assert (pupil.problem.code, pupil.problem.number) == (code, 9)
    assert lesson.hub.leasing.version == version


@pytest.mark.parametrize("message", [RequestControl(9), Withdraw(9), GiveControl(9, 1), Who(9)])
def test_without_a_class_there_is_nothing_of_it(message):
    hub = make_hub()
    pupil = Pupil(hub, role=Role.ADMIN, token=ADMIN, name="Ada\n")
    assert (pupil.lease.member, pupil.welcome.role) == (0, Role.ADMIN)
    pupil.tell(message, now=0.1)
    assert (pupil.problem.code, pupil.problem.number) == (ProblemCode.NOT_ALLOWED, 9)
    pupil.ask(Acquire, now=0.2)
    assert pupil.lease.holder == "Ada\n", "names are as they come"


def test_a_program_of_this_process_has_no_number_and_waits_as_others():
    lesson = Lesson()
    seat = lesson.hub.join("terminals")
    ada = lesson.pupil("Ada")
    ada.ask(Who, now=0.0)
    assert lesson.hub.leasing.wish(seat, Acquire(1), 0.1).yours
    assert ada.ask(RequestControl, now=0.2).waiting == 1
    ada.look(now=0.5)
    assert (ada.present.holder, [member.name for member in ada.present.members]) == (0, ["Ada"])
    lesson.hub.leasing.wish(seat, Release(2, lesson.hub.leasing.lease.epoch), 0.6)
    assert told(ada, now=0.6) == ["offered"]
    assert lesson.hub.leasing.wish(seat, Acquire(3), 0.7).code is ProblemCode.LEASE


# In the order in which they connect.


def test_in_order_the_first_to_connect_is_offered_control_and_then_the_next():
    hub = make_hub(in_order=True)
    ada, eve = Pupil(hub, name="Ada"), Pupil(hub, name="Eve", role=Role.VIEWER, now=0.1)
    bo, cy = Pupil(hub, name="Bo", now=0.2), Pupil(hub, name="Cy", now=0.3)
    assert told(ada, eve, bo, cy, now=0.4) == ["offered", 0, 2, 3]
    assert hub.lease_state is LeaseState.FREE, "nobody has it who hasn't asked"
    assert bo.ask(Acquire, now=0.5).code is ProblemCode.LEASE
    epoch = ada.ask(Acquire, now=0.6).epoch
    assert told(ada, eve, bo, cy, now=0.7) == ["has it", 0, 1, 2]
    assert [member.name for member in ada.ask(Who, now=0.8).members] == ["Ada", "Bo", "Cy", "Eve"]
    order = ada.tell(Order(1, to(1), epoch), now=0.9)
    assert next(m for m in order if m.kind == "outcome").refusal == ""
    ada.leave(now=1.0)
    # Its lease runs out, the robot stops, and the next one's turn has come.
    assert told(bo, cy, now=3.0) == ["offered", 2]
    assert hub.robot.log[-1][0] == "ended"
    assert bo.ask(Acquire, now=3.1).yours


def test_in_order_who_lets_it_pass_or_gives_it_back_waits_behind_the_others_when_asking_again():
    hub = make_hub(in_order=True)
    ada, bo, cy = (Pupil(hub, name=name) for name in ("Ada", "Bo", "Cy"))
    ada.look(now=0.1)
    late = 0.1 + OFFERED
    assert told(ada, bo, cy, now=late) == [0, "offered", 2]
    epoch = bo.ask(Acquire, now=late).epoch
    assert ada.ask(RequestControl, now=late).waiting == 2
    bo.ask(Release, epoch, now=late + 0.1)
    assert told(ada, bo, cy, now=late + 0.2) == [2, 0, "offered"]


def test_in_order_an_admin_takes_over_and_waits_for_nobody():
    hub = make_hub(in_order=True)
    admin, ada = Pupil(hub, name="Root", role=Role.ADMIN, token=ADMIN), Pupil(hub, name="Ada", now=0.1)
    assert told(admin, ada, now=0.2) == [0, "offered"]
    ada.ask(Acquire, now=0.3)
    admin.ask(TakeOver, now=0.4)
    assert told(admin, ada, now=0.5) == ["has it", 0]


# Whatever they do.


@pytest.mark.parametrize("seed", range(20))
def test_whatever_they_do_one_has_control_and_the_first_who_is_here_is_offered_it(seed):
    random, lesson, now = Random(seed), Lesson(stops=False), 0.0
    leasing = lesson.hub.leasing
    room = leasing.classroom
    pupils = [lesson.teacher(), *(lesson.pupil(f"pupil {k}", address=str(k)) for k in range(6))]
    away = set()
    for _ in range(300):
        now += random.choice((0.0, 0.01, 0.1, 1.0, 3.0))
        k = random.randrange(len(pupils))
        pupil, other = pupils[k], random.randrange(1, 9)
        epoch = pupil.lease.epoch or random.randrange(1, 50)
        message = random.choice(
            (
                RequestControl(1), RequestControl(1), Acquire(1), Release(1, epoch), control.Beat(epoch),
                Withdraw(1), Withdraw(1, other), GiveControl(1, other), TakeOver(1), Who(1), None, None,
            )
        )  # fmt: skip
        if k in away:
            session = pupil.welcome.session
            token = ADMIN if k == 0 else lesson.code(now=now)
            role = Role.ADMIN if k == 0 else Role.OPERATOR
            pupils[k] = Pupil(lesson.hub, role=role, token=token, session=session, address=str(k), now=now)
            assert pupils[k].welcome is not None
            away.discard(k)
        elif message is None:
            pupil.leave(now=now, done=random.random() < 0.5)
            away.add(k)
        else:
            pupil.tell(message, now=now)
        if random.random() < 0.5:
            lesson.hub.stopped(now=now)
        here = [one for j, one in enumerate(pupils) if j not in away]
        for one in here:
            one.look(now=now)
        free, waiting = lesson.hub.lease_state is LeaseState.FREE, room.waiting
        assert sum(one.lease.yours for one in here) <= 1
        assert len(set(waiting)) == len(waiting)
        assert leasing.holder not in waiting
        assert (room.offered is not None) == (free and bool(waiting))
        assert room.offered is None or (room.offered.here and room.offered in waiting)
        offered = [one for one in here if one.lease.offered_until is not None]
        assert [one.lease.member for one in offered] == ([room.offered.member] if room.offered else [])
        assert sorted(one.lease.waiting for one in here if one.lease.waiting) == list(range(1, len(waiting) + 1))
