"""Trials fitted to the free run of the whole recordings, each set of effects once."""

from collections.abc import Callable, Sequence

import numpy as np

from emir_analysis.diagnosis.evidence import Evidence
from emir_analysis.diagnosis.fitting import (
    following,
    glimpsed,
    refine_free_run,
    with_fewer_terms,
)
from emir_analysis.diagnosis.friction_beginning import follows_the_beginning, gradually
from emir_analysis.diagnosis.friction_laws import (
    BY_LOAD,
    VISCOUS,
    along_the_way,
    breakaway_may_be_none,
    elastic,
    gradual,
    is_along_the_way,
    is_gradual,
    sticks,
    uneven,
    viscous_is_heard,
    with_square,
    without_breakaway,
)
from emir_analysis.diagnosis.held_open import held_open
from emir_analysis.diagnosis.late_command import late_command
from emir_analysis.diagnosis.loads import LOAD, mean_while_it_acts
from emir_analysis.diagnosis.next_law import Laws, next_laws
from emir_analysis.diagnosis.payload_place import with_place
from emir_analysis.diagnosis.run_errors import free_run_errors, mean_square
from emir_analysis.diagnosis.select import (
    AT_NOISE,
    EXPLAINED,
    HOPELESS,
    LEFT,
    MOST,
    STRONG,
    beyond,
    excess,
    free_run_score,
)
from emir_analysis.diagnosis.side_by_side import side_by_side
from emir_analysis.diagnosis.stick_slip import OFF, Grown, Growths
from emir_analysis.diagnosis.telling import TWO_DEVIATIONS, between_steps
from emir_analysis.diagnosis.trial import Trial, moved, with_all_terms
from emir_analysis.signals import Array
from emir_common.parameter_tree import declared
from emir_plant.effects import REGISTRY
from emir_plant.effects.payload import Payload
from emir_plant.sheet import Sheet

STEADY = ("sensor_bias", LOAD)  # beside friction as one that differs with the direction
TERM = 6.6  # squared errors, in units of the noise: a term that tells nothing takes away no more
# in 99 of 100 recordings

Progress = Callable[[str], None]


class Whole:
    """What has been fitted to the whole recordings. floor: (5,) of the balances."""

    def __init__(self, evidence: Evidence, sheet: Sheet, floor: Array, progress: Progress) -> None:
        self._evidence, self._sheet = evidence, sheet
        self._floor, self._progress = floor, progress
        self._known: dict[tuple[str, ...], Trial] = {}
        self._growths = Growths(evidence)
        self._with_fewest: set[frozenset[str]] = set()  # sizes that are all needed

    def fitted(self, chosen: Trial) -> Trial:
        """Return a trial fitted to the free run of the whole recordings."""
        if chosen.effects not in self._known:
            self._progress(f"fitting to the whole recording: {chosen.name}")
            fitted = self.led(chosen, AT_NOISE) or refine_free_run(chosen, self._evidence)
            if beyond(LEFT) < self._excess(fitted) < beyond(HOPELESS):
                fitted = self._with_fewer_sizes(fitted)
                if sticks(fitted):
                    fitted = self._with_seals_that_give(self._led_again(fitted))
                else:
                    fitted = self._with_other_shares(self._refined_again(fitted))
                    fitted = self._with_more(with_square, fitted)
            fitted = self._with_more(held_open, self._with_payload_elsewhere(fitted))
            fitted = self._with_simple_load(self._with_simple_shares(fitted))
            self._known[chosen.effects] = self._in_usual_form(fitted)
        return self._known[chosen.effects]

    def fitted_score(self, chosen: Trial) -> float:
        """Return the score of a trial fitted to the free run of the whole recordings."""
        return self.score(self.fitted(chosen))

    def fitted_from(self, begun: Trial) -> Trial:
        """Return a trial fitted from where it is begun, if that is better than what is known.

        With the same effects a fit may have begun elsewhere and led nowhere.
        """
        known = self._known.get(begun.effects)
        if known is not None and self.score(begun) < self.score(known):
            del self._known[begun.effects]
        return self.fitted(begun)

    def led(self, chosen: Trial, most: float = LEFT) -> Trial | None:
        """Return a trial that sticks led along a beginning that grows, if it is all that is needed.

        Over all of a recording at once a fit takes long, and ends close to where it began.
        most: that it may leave, in units of the noise.
        """
        if not sticks(chosen) or self._excess(chosen) <= beyond(LEFT):
            return None
        if not follows_the_beginning(chosen, self._evidence):
            return None
        led = self._growths.followed(chosen)
        return led.trial if led.left_of_whole <= most else None

    def _refined_again(self, fitted: Trial) -> Trial:
        """Return a trial fitted again from where it ended, as long as that helps much.

        Where something switches, slopes lead only a little way at a time.
        """
        while self._excess(fitted) > beyond(LEFT):
            again = refine_free_run(fitted, self._evidence)
            if self.score(again) > self.score(fitted) - STRONG:
                break
            fitted = again
        return fitted

    def _led_again(self, fitted: Trial) -> Trial:
        """Return a trial that sticks led along a beginning that grows, if that is better.

        Over all of a recording at once a fit ends close to where it began.
        """
        return min(fitted, self._growths.grown(fitted).trial, key=self.score)

    def _with_seals_that_give(self, fitted: Trial) -> Trial:
        """Return a trial whose friction under load comes along the way, if that is better.

        If not already; other friction is asked so over a beginning, which tells its law.
        """
        if BY_LOAD not in fitted.effects:
            return fitted
        best, giving = fitted, along_the_way(fitted)
        for law in (giving, elastic(giving)):
            if law is not fitted and self._excess(best) > beyond(LEFT):
                led = following(law, self._evidence)
                best = min(best, refine_free_run(led, self._evidence, best), key=self.score)
        return best

    def _with_fewer_sizes(self, full: Trial) -> Trial:
        """Return a trial with one size of its effects alone where that is better than with all.

        Beside another that explains nothing a size may not find its way.
        """
        best = full
        for effect in full.effects:
            if REGISTRY[effect].is_series:
                best = self._with_terms_that_tell(best, effect)
                continue
            alone = min(best.with_each_size(effect), key=self.score, default=None)
            if alone is not None:
                best = min(best, refine_free_run(alone, self._evidence, best), key=self.score)
        self._with_fewest.add(_sizes(best))
        return best

    def _with_terms_that_tell(self, known: Trial, effect: str) -> Trial:
        """Return a trial with the fewest terms of a series that leave no more than any number.

        Beyond the strokes that were recorded each term too many leads astray.
        """
        full = refine_free_run(with_all_terms(known, effect, self._sheet), self._evidence)
        ways = [full, *with_fewer_terms(full, effect, self._evidence)]
        count = sum(error.size for error in free_run_errors(known.machine, self._evidence))
        left = np.array([mean_square(way, self._evidence) for way in ways])
        as_good = np.flatnonzero(left <= np.nanmin(left) + TERM / count)
        return ways[int(as_good[-1])]

    def _with_other_shares(self, fitted: Trial) -> Trial:
        """Return a trial fitted again from none and all of its shares, where that is better.

        A share may have been led to the wrong place while another effect was missing. One that
        does next to nothing, as the direction of a force that is all on the piston, or is there
        already, leads nowhere.
        """
        for k, unknown in enumerate(fitted.unknowns.members):
            for end in (unknown.low, unknown.high) if unknown.is_share else ():
                begun = fitted.at(moved(fitted.x, [k], [end]))
                elsewhere = abs(self.score(begun) - self.score(fitted)) > STRONG
                if elsewhere and self._excess(fitted) > beyond(LEFT):
                    begun = glimpsed(begun, self._evidence)
                    if self.score(begun) < self.score(fitted) - STRONG:
                        fitted = refine_free_run(begun, self._evidence)
        return fitted

    def _with_simple_shares(self, fitted: Trial) -> Trial:
        """Return a trial whose shares are none or all of it where that is as good.

        What the recordings do not tell, chance would decide; where both do, what is usual is taken.
        """
        for unknown in fitted.unknowns.members:
            if unknown.is_share:
                usual = round(declared(self._sheet.machine)[unknown.path][1])
                ends = [fitted.fixed(unknown.path, float(end)) for end in (usual, 1 - usual)]
                score = self.score(fitted)
                fitted = next((end for end in ends if self.score(end) <= score), fitted)
        return fitted

    def _with_payload_elsewhere(self, fitted: Trial) -> Trial:
        """Return a trial whose payload is not at the TCP, where that takes most of the rest away.

        What a search has begun elsewhere need not be just there.
        """
        begun, at_tcp = with_place(fitted), fitted.machine.effects.payload.place == Payload.place
        if begun is None or (at_tcp and self._excess(fitted) <= beyond(LEFT)):
            return fitted
        return self._if_most_goes(begun, fitted)

    def _with_more(self, more: Callable[[Trial], Trial | None], fitted: Trial) -> Trial:
        """Return a trial with what else may be fitted, where that takes most of the rest away.

        more: a trial -> one that is begun with it, or None.
        """
        begun = more(fitted)
        if begun is None or self._excess(fitted) <= beyond(LEFT):
            return fitted
        return self._if_most_goes(begun, fitted)

    def _if_most_goes(self, begun: Trial, fitted: Trial) -> Trial:
        """Return a trial fitted from where it is begun, where most of what another leaves goes."""
        found = refine_free_run(begun, self._evidence)
        return found if self._excess(found) < MOST * self._excess(fitted) else fitted

    def _with_simple_load(self, fitted: Trial) -> Trial:
        """Return a trial whose load from outside is steady or does not decay, if that is as good.

        Over the time that it acts a slow swing is the same as a steady load.
        """
        if LOAD not in fitted.effects or self._excess(fitted) > beyond(HOPELESS):
            return fitted
        start = f"effects.{LOAD}."
        paths = [unknown.path for unknown in fitted.unknowns.members]
        load, still = fitted.machine.effects.external_load, fitted
        if start + "force" in paths:
            k, x = paths.index(start + "force"), fitted.x.copy()
            end = max(float(e.time[-1]) for e in self._evidence.experiments)
            x[k] = fitted.unknowns.members[k].at(mean_while_it_acts(load, end))
            still = fitted.at(x).fixed(start + "mean", 0.0)
        for name in ("frequency", "phase", "decay"):
            still = still.fixed(start + name, 0.0)
        lasting = fitted.fixed(start + "decay", 0.0)
        ways = [refine_free_run(still, self._evidence, fitted), lasting]
        score = self.score(fitted)
        return next((way for way in ways if self.score(way) <= score), fitted)

    def plainer(self, fitted: Trial) -> Trial:
        """Return a trial with one size of an effect alone where that explains the whole as well.

        Or with Coulomb's friction in place of one whose break-away may be none, with a late command
        in place of sensors that are all equally late, or with what is usual for a share.
        Two sizes together may lead to where neither is right, such as a negative compliance.
        """
        fitted = self._with_uneven_friction(self._with_late_command(fitted))
        if not sticks(fitted):
            if _sizes(fitted) not in self._with_fewest:
                fitted = self._with_fewer_sizes(fitted)
            fitted = self._past_its_steps(fitted)
        elif breakaway_may_be_none(fitted):
            plain = without_breakaway(fitted, self._sheet)
            smooth = refine_free_run(plain, self._evidence, fitted)
            fitted = min(smooth, fitted, key=self.score)
        fitted = self._with_usual_shares(fitted)
        self.keep(fitted)
        return fitted

    def _past_its_steps(self, fitted: Trial) -> Trial:
        """Return a trial with fewer sizes of what acts in steps, fitted from beyond these as well.

        Between two steps a fit does its best: other sizes make up for a threshold that is off.
        """
        fewer = self._best_of(fitted, _with_two_sizes(fitted))
        return self._best_of(fewer, self._beyond_steps(fewer))

    def _best_of(self, fitted: Trial, begun: Sequence[Trial]) -> Trial:
        """Return a trial, or the best of those fitted from where they are begun if it is better."""
        again = side_by_side(lambda way: refine_free_run(way, self._evidence), begun)
        best = min([fitted, *again], key=self.score)
        return best if self.score(best) < self.score(fitted) - TWO_DEVIATIONS else fitted

    def _beyond_steps(self, fitted: Trial) -> list[Trial]:
        """Return trials, each with one of what acts in steps moved to where it acts otherwise."""
        return [
            fitted.at(moved(fitted.x, [k], [unknown.at(end)]))
            for k, unknown in enumerate(fitted.unknowns.members)
            if unknown.is_stepwise
            for end in between_steps(fitted, k, self._evidence)
        ]

    def _in_usual_form(self, fitted: Trial) -> Trial:
        """Return a trial with its effects in their usual form, where that explains as well.

        One edge of a valve that is off beside a null offset is both edges beside another offset.
        """
        for effect in fitted.effects:
            begun = fitted.forms(effect)[0]
            if begun.form != fitted.form:
                usual = refine_free_run(begun, self._evidence, fitted)
                if self.score(usual) < self.score(fitted) + STRONG:
                    fitted = usual
        return fitted

    def _with_usual_shares(self, fitted: Trial) -> Trial:
        """Return a trial fitted again with what is usual for shares in between, where as good.

        Along with a size beside it a share is led far where little changes, as that of a leak of
        a chamber whose pressure is not measured.
        """
        for k, unknown in enumerate(fitted.unknowns.members):
            if unknown.is_share and unknown.low < fitted.x[k] < unknown.high:
                usual = round(declared(self._sheet.machine)[unknown.path][1])
                fixed = fitted.fixed(unknown.path, float(usual))
                again = refine_free_run(fixed, self._evidence, fitted)
                if self.score(again) <= self.score(fitted):
                    return self._with_usual_shares(again)
        return fitted

    def _with_late_command(self, fitted: Trial) -> Trial:
        """Return a trial with a late command for sensors all equally late, if that is as good."""
        begun = late_command(fitted, self._sheet)
        if begun is None:
            return fitted
        late = refine_free_run(begun, self._evidence, fitted)
        return late if self.score(late) <= self.score(fitted) else fitted

    def _with_uneven_friction(self, fitted: Trial) -> Trial:
        """Return a trial with uneven friction for a steady force beside an even one, if as good.

        Before the first move the two are not the same.
        """
        for effect in STEADY if sticks(fitted) else ():
            if effect in fitted.effects:
                found = refine_free_run(uneven(fitted.without(effect)), self._evidence)
                if self._excess(found) <= beyond(EXPLAINED):
                    found = self._led_again(found)
                if self.score(found) <= self.score(fitted):
                    return found
        return fitted

    def keep(self, fitted: Trial) -> None:
        """Take a trial as the one that is fitted with its effects."""
        self._known[fitted.effects] = fitted

    def known(self) -> list[Trial]:
        """Return all that has been fitted."""
        return list(self._known.values())

    def better(self, fitted: Trial) -> Trial:
        """Return a trial, or the one known with the same effects where that is better."""
        return min(fitted, self._known.get(fitted.effects, fitted), key=self.score)

    def score(self, fitted: Trial) -> float:
        """Return the score of the free run of the whole recordings; smaller is better."""
        return free_run_score(fitted, self._evidence, seen=0.0)

    def _excess(self, tried: Trial) -> float:
        return excess(tried, self._evidence)

    def with_friction(self, law: Trial, fuller: Sequence[Trial], rival: Trial) -> Trial:
        """Return a law of friction fitted to the whole; a fuller one if that alone is at the noise.

        A break-away may show in later sticks than those of the beginning, and whether friction
        comes by tanh or gradually shows in many sticks only. Along the way that seals give only
        where none by the velocity is at the noise. What else is missing shows in the beginning
        over which a law no longer follows the machine.
        """
        found, (law, fuller) = self._following(Laws(law, fuller), rival)
        ways = [along_the_way(f) for f in (law, *fuller)]
        by_the_way = is_along_the_way(law)
        if LEFT < found.left < HOPELESS and not is_gradual(law) and not by_the_way:
            late = self._instead(found, gradually(law, self._evidence), rival)
            if late is not found:
                found, fuller = late, [gradual(more) for more in fuller]
        found = self._fuller(found, fuller)
        if AT_NOISE < found.left < HOPELESS and not by_the_way:
            found = self._fuller(self._instead(found, ways[0], rival), ways[1:])
        return self._heard(found.trial)

    def _following(self, laws: Laws, rival: Trial) -> tuple[Grown, Laws]:
        """Return laws of which the first follows the machine to the end, led to the whole.

        The same where none does, led as far as it is no worse than a rival.
        """
        told, led = laws, self._growths.followed(laws.law)
        while led.left_of_whole > LEFT:
            self._progress(f"what else the first {led.time:.0f} s say: {led.trial.name}")
            found = next_laws(led, told, self._evidence, self._sheet)
            if found is None:
                break
            told = found.laws
            if led.given_up:
                led = self._growths.followed(told.law)
            else:
                led = led._replace(trial=told.law, left=found.left)
        if led.given_up:
            return self._growths.grown(laws.law, rival), laws
        return (led if told is laws else self._without_viscous(led)), told

    def _without_viscous(self, led: Grown) -> Grown:
        """Return a law without viscous friction, which may have been needed on the way only.

        As it was where that is not at the noise.
        """
        if VISCOUS not in led.trial.effects:
            return led
        less = self._growths.followed(led.trial.without(VISCOUS))
        return less if less.left_of_whole <= LEFT else led

    def _instead(self, found: Grown, law: Trial, rival: Trial) -> Grown:
        """Return a law led to the whole where it leaves less than what was found.

        Where that leaves little, it has to come to the noise: else it is off as well.
        """
        if found.left_of_whole <= OFF:
            led = self._growths.at_noise(law) or found
        else:
            led = self._growths.grown(law, min(found.trial, rival, key=self.score))
        return min(found, led, key=lambda each: each.left_of_whole)

    def _fuller(self, found: Grown, fuller: Sequence[Trial]) -> Grown:
        """Return the first of fuller laws that is at the noise, where what was found is not."""
        if found.left_of_whole <= AT_NOISE:
            return found
        led = self._first_at_noise(fuller)
        return found if led is None else led

    def _first_at_noise(self, laws: Sequence[Trial]) -> Grown | None:
        all_at_noise = (self._growths.at_noise(law) for law in laws)
        return next((led for led in all_at_noise if led is not None), None)

    def at_noise(self, laws: list[Trial]) -> Trial | None:
        """Return the first of laws of friction that is at the noise when it is led to the whole."""
        led = self._first_at_noise(laws)
        return None if led is None else led.trial

    def _heard(self, led: Trial) -> Trial:
        """Return a trial without viscous friction that has become too small to be heard.

        It may have led to where the machine sticks at the right instants, and is needed no more.
        """
        if VISCOUS not in led.effects or viscous_is_heard(led, self._evidence, self._floor):
            return led
        return refine_free_run(led.without(VISCOUS), self._evidence)


def _with_two_sizes(fitted: Trial) -> list[Trial]:
    """Return trials with two sizes of an effect alone, the first of those that act in steps one."""
    ways = []
    for effect in fitted.effects:
        first = REGISTRY[effect].stepwise[:1]
        others = [size for size in fitted.sizes(effect) if size not in first]
        if first and others[1:]:
            ways += [fitted.with_sizes(effect, (*first, other)) for other in others]
    return ways


def _sizes(fitted: Trial) -> frozenset[str]:
    """Return the sizes of effects that are fitted, by dotted path."""
    members = fitted.unknowns.members
    return frozenset(u.path for u in members if not (u.toleranced or u.shapes))
