"""Play-back in virtual time: frames are g at any rate; loops, steps, two clocks, files that grow or are cut."""

from __future__ import annotations

import numpy as np
import pytest

from interfaces.clients.playhead import Mode
from interfaces.recording.headless import PlaybackFrames
from interfaces.recording.playback import LAG, Align, Playback
from interfaces.recording.recording import Recording, open_recording
from tests.interfaces.recording.made import BEHIND, MODEL, Site, make
from vrs.errors import FormatError, InvalidValueError


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    path = tmp_path_factory.mktemp("made") / "run.mcap"
    return path, make(path, 6.0)


@pytest.fixture
def playback(made):
    with open_recording(made[0]) as recording:
        yield Playback([recording])


def run(playback, seconds, *, hz=50.0, begun=0.0):
    """Frames of so many seconds of the user's time, with the marks."""
    frames = PlaybackFrames(playback, rate=hz, begun=begun)
    found = []
    while frames.due <= begun + seconds + 1e-9:
        one = frames.next(now=frames.due)
        if one is not None:
            found.append(one)
    return found


class TestFrames:
    @pytest.mark.parametrize("rate", [-8.0, -4.0, -1.0, -0.05, 0.25, 1.0, 4.0, 8.0])
    def test_each_shows_g_at_the_place_where_the_rate_leads(self, made, playback, rate):
        playback.seek(0.0 if rate > 0 else 6.0, now=0.0)
        playback.play(now=0.0, rate=rate)
        begin = playback.place(now=0.0)
        found = run(playback, 20.0)
        engine = made[1].engine
        assert len(found) == 1 + min(20 * 50, int(np.ceil(6.0 / abs(rate) * 50 - 1e-6)))
        for at, moment, _ in found:
            frame = moment.frames[0]
            assert frame.t == moment.t == pytest.approx(min(max(begin + rate * at, 0.0), 6.0), abs=1e-9)
            assert np.abs(frame.q_virtual - engine.joints(frame.t)).max() <= 1e-9
        if abs(rate) > 0.3:
            assert playback.mode is Mode.PAUSED
            assert found[-1][1].t == (6.0 if rate > 0 else 0.0)

    def test_the_real_robot_is_where_it_was_and_its_error_is_that_of_equal_timeline_time(self, made, playback):
        engine = made[1].engine
        for t in (0.0, 0.5, 1.2345, 3.0, 5.99):
            frame = playback.moment(t).frames[0]
            assert frame.behind == pytest.approx(BEHIND, abs=1e-9)
            assert np.abs(frame.q_real - engine.joints(t - BEHIND)).max() < 2e-3
            expected = np.abs(frame.q_real - engine.joints(frame.play)).max()
            assert frame.error == pytest.approx(expected, abs=1e-12)

    def test_the_committed_path_is_of_the_plan_that_was_known_then(self, made, playback):
        track = playback.tracks[0]
        for t in (0.1, 0.2, 1.0, 1.59, 2.9, 4.2, 5.9):
            known = [timeline for at, timeline in made[1].timelines if at <= t][-1]
            committed = track.committed(playback.moment(t).frames[0])
            assert committed.timeline == known
            assert committed.play == pytest.approx(t - BEHIND, abs=1e-9)
            assert track.committed(playback.moment(t).frames[0]).timeline is committed.timeline

    def test_marks_are_passed_once_each_either_way(self, playback):
        playback.read_marks()
        marks = list(playback.tracks[0].marks.marks)
        playback.play(now=0.0, rate=3.0)
        there = [mark for _, _, passed in run(playback, 3.0) for mark in passed[0]]
        assert there == marks
        playback.play(now=10.0, rate=-2.0)
        back = [mark for _, _, passed in run(playback, 4.0, begun=10.0) for mark in passed[0]]
        assert back == marks[::-1]

    def test_in_a_loop_marks_come_again(self, playback):
        playback.read_marks()
        playback.play(now=0.0, rate=1.0)
        playback.set_loop(0.85, 1.65, now=0.0)
        for rate in (1.0, -1.0):
            playback.play(now=0.0, rate=rate)
            found = run(playback, 8.0, hz=37.0)
            times = [mark.t for _, _, passed in found for mark in passed[0]]
            assert times.count(0.9) == 10
            assert times.count(1.6) == 20
            assert all(0.85 <= moment.t <= 1.65 for _, moment, _ in found)

    def test_one_who_is_late_gets_the_newest_and_the_rate_stays(self, playback):
        playback.play(now=0.0, rate=2.0)
        frames = PlaybackFrames(playback, rate=50.0, begun=0.0)
        frames.next(now=0.0)
        at, moment, _ = frames.next(now=1.007)
        assert (at, moment.t) == (pytest.approx(1.0), pytest.approx(2.0))
        assert frames.due == pytest.approx(1.02)


class TestMoving:
    def test_it_begins_at_the_start_and_stands(self, playback):
        assert (playback.mode, playback.place(now=100.0)) == (Mode.PAUSED, 0.0)
        assert playback.span == (0.0, 6.0)

    def test_play_at_an_end_begins_at_the_other(self, playback):
        playback.seek(6.0, now=0.0)
        playback.play(now=0.0)
        assert playback.place(now=0.5) == pytest.approx(0.5)
        playback.seek(0.0, now=1.0)
        playback.play(now=1.0, rate=-1.0)
        assert playback.place(now=1.5) == pytest.approx(5.5)

    def test_steps_and_marks(self, playback):
        playback.read_marks()
        playback.seek(0.5, now=0.0)
        playback.play(now=0.0)
        playback.step(1 / 60, now=0.5)
        assert (playback.mode, playback.place(now=9.0)) == (Mode.PAUSED, pytest.approx(1.0 + 1 / 60))
        seen = []
        while playback.seek_mark(back=False, now=1.0) is not None and len(seen) < 99:
            seen.append(playback.place(now=1.0))
        assert seen == sorted({mark.t for mark in playback.tracks[0].marks.marks if mark.t > 1.1})
        while playback.seek_mark(back=True, now=1.0) is not None and len(seen) < 99:
            seen.append(playback.place(now=1.0))
        assert seen[-1] == pytest.approx(0.2)

    def test_rates_beyond_8_and_0_are_refused(self, playback):
        for rate in (0, 8.1, -9, np.nan, "2"):
            with pytest.raises(InvalidValueError):
                playback.play(now=0.0, rate=rate)
            with pytest.raises(InvalidValueError):
                playback.set_rate(rate, now=0.0)
        assert playback.mode is Mode.PAUSED
        with pytest.raises(InvalidValueError):
            playback.go_live(now=0.0)

    @pytest.mark.parametrize("rate", [1.0, -1.0])
    def test_a_loop_over_all_goes_on(self, playback, rate):
        playback.play(now=0.0, rate=rate)
        playback.set_loop(-5.0, 99.0, now=0.0)
        found = run(playback, 30.0, hz=10.0)
        assert playback.mode is Mode.PLAYING
        assert len(found) >= 295


class TestTwo:
    def test_equal_times_are_shown_together_and_what_is_over_stands(self, made, tmp_path):
        other = make(tmp_path / "other.mcap", 4.0)
        with open_recording(made[0]) as one, open_recording(tmp_path / "other.mcap") as two:
            playback = Playback([one, two])
            assert playback.span == (0.0, 6.0)
            for t in (0.3, 3.9, 5.0):
                first, second = playback.moment(t).frames
                assert first.t == second.t == t
                assert np.abs(second.q_virtual - other.engine.joints(t)).max() <= 1e-9
                assert (second.q_real is None) == (t > 4.0)

    def test_the_nearest_mark_of_either_is_gone_to(self, tmp_path):
        make(tmp_path / "a.mcap", 4.0, began=1000.0)
        make(tmp_path / "b.mcap", 4.0, began=1001.5)
        with open_recording(tmp_path / "a.mcap") as one, open_recording(tmp_path / "b.mcap") as two:
            playback = Playback([one, two], align=Align.BEGAN)
            playback.read_marks()
            places = sorted({mark.t + track.shift for track in playback.tracks for mark in track.marks.marks})
            assert len(places) > len({mark.t for mark in playback.tracks[0].marks.marks})
            for back in (False, True):
                playback.seek(5.5 if back else 0.0, now=0.0)
                seen = []
                while playback.seek_mark(back=back, now=0.0) is not None and len(seen) < 99:
                    seen.append(playback.place(now=0.0))
                assert seen == pytest.approx(places[::-1] if back else places)

    def test_by_the_calendar(self, tmp_path):
        make(tmp_path / "a.mcap", 4.0, began=1000.0)
        make(tmp_path / "b.mcap", 4.0, began=1001.5)
        with open_recording(tmp_path / "a.mcap") as one, open_recording(tmp_path / "b.mcap") as two:
            playback = Playback([one, two], align=Align.BEGAN)
            assert playback.span == (0.0, 5.5)
            playback.read_marks()
            first, second = playback.moment(3.0).frames
            assert (first.t, second.t) == (3.0, 1.5)
            playback.play(now=0.0, rate=4.0)
            found = run(playback, 2.0)
            late = [mark.t for _, moment, passed in found for mark in passed[1] if moment.t - 1.5 - mark.t > 0.081]
            assert late == []
            assert sum(len(passed[1]) for _, _, passed in found) == len(playback.tracks[1].marks.marks)

    def test_what_cannot_be_aligned_is_refused(self, made):
        with open_recording(made[0]) as one, open_recording(made[0]) as two:
            with pytest.raises(InvalidValueError):
                Playback([one, two], align=Align.BEGAN)
            with pytest.raises(InvalidValueError):
                Playback([])


class TestGrowing:
    def watched(self, tmp_path):
        site = Site(tmp_path / "run.mcap", length=30.0, flush=0.25)
        site.run(1.0)
        recording = open_recording(tmp_path / "run.mcap")
        return site, recording, Playback([recording])

    def test_live_while_it_is_written_and_whoever_scrubs_back_stays_there(self, tmp_path):
        site, recording, playback = self.watched(tmp_path)
        with recording:
            now, ages = 0.0, []
            for k in range(600):
                now = 1.0 + k / 60
                site.run(now)
                moment = playback.advance(now=now)
                frame = moment.frames[0]
                assert np.abs(frame.q_virtual - site.engine.joints(frame.t)).max() <= 1e-9
                if k == 60:
                    assert playback.growing
                    playback.go_live(now=now)
                if k == 300:
                    assert playback.mode is Mode.LIVE
                    playback.seek(2.0, now=now)
                    playback.pause(now=now)
                if 200 < k < 300:
                    ages.append(now - moment.t)
                    assert frame.q_real is not None
                if k > 300:
                    assert (playback.mode, moment.t) == (Mode.PAUSED, 2.0)
            assert 0.3 <= min(ages) <= max(ages) <= LAG + 0.35
            playback.go_live(now=now)
            site.run(now + 1.5)
            site.end()
            for k in range(900):
                moment = playback.advance(now=now + k / 60)
            assert not playback.growing
            assert (playback.mode, moment.t) == (Mode.PAUSED, playback.span[1])
            assert playback.span[1] == pytest.approx(now + 1.5, abs=0.02)
            marks = playback.tracks[0].marks
            assert sum(mark.kind == "command" for mark in marks.marks) >= 10

    def test_a_file_that_stops_growing_is_played_to_its_end(self, tmp_path):
        site, recording, playback = self.watched(tmp_path)
        with recording:
            playback.advance(now=0.0)
            for k in range(120):
                site.run(1.0 + k / 60)
                playback.advance(now=k / 60)
            playback.go_live(now=2.0)
            for k in range(600):
                moment = playback.advance(now=2.0 + k / 60)
            assert not playback.growing
            assert (playback.mode, moment.t) == (Mode.PAUSED, playback.span[1])
            site.writer.abandon()

    def test_headless_follows_it_to_the_end(self, tmp_path):
        site, recording, playback = self.watched(tmp_path)
        with recording:
            playback.play(now=0.0, rate=8.0)
            frames, seen = PlaybackFrames(playback, rate=50.0, begun=0.0), []
            for k in range(1000):
                now = k / 50
                if now < 5.0:
                    site.run(1.0 + now)
                found = frames.next(now=now)
                if found is not None:
                    seen.append(found[1].t)
                if frames.over(now=now):
                    break
            site.writer.abandon()
            assert seen[-1] == playback.span[1] > 5.0
            assert (np.diff(seen) > 0).all()


def test_what_makes_no_sense_is_left_out_and_the_rest_is_played(made, monkeypatch):
    def fails(self, *_):
        raise FormatError("run.mcap", "the block with the timeline is destroyed")

    for name in ("virtual", "timeline_at"):
        monkeypatch.setattr(Recording, name, fails)
    monkeypatch.setattr(Recording, "edits", property(fails))
    with open_recording(made[0]) as recording:
        playback = Playback([recording])
        (frame,) = playback.advance(now=0.0).frames
        assert frame.q_virtual is frame.error is None
        assert frame.q_real is not None
        assert playback.tracks[0].committed(frame) is None
        assert "destroyed" in playback.tracks[0].problem


def test_a_cut_file_plays_and_nothing_is_made_up(tmp_path):
    path = tmp_path / "run.mcap"
    site = make(path, 6.0)
    data = path.read_bytes()
    path.write_bytes(data[: int(0.6 * len(data))])
    with open_recording(path) as recording:
        assert recording.damage
        playback = Playback([recording])
        playback.play(now=0.0, rate=8.0)
        found = run(playback, 3.0)
        assert 2.0 < found[-1][1].t < 6.0
        for _, moment, _ in found:
            q = moment.frames[0].q_virtual
            assert q is None or np.abs(q - site.engine.joints(moment.t)).max() <= 1e-9
        assert MODEL.name == recording.model.name
