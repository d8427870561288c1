"""Sentences for the demo corpus: templates of ours, and word lists for the sounds they miss.

Goes out: US English without digits or abbreviations. The same generator state gives the same
sentence. Knows nothing of voices.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np

Generator = np.random.Generator


def _items(listed: str) -> tuple[str, ...]:
    return tuple(" ".join(item.split()) for item in listed.split("/"))


WHO = _items(
    """
    my brother / the baker / our old neighbor / a famous painter / the young pilot / her best
    friend / the people next door / every member of the band / the shy boy / a very patient farmer
    / the woman in the blue coat / my father / both of my cousins / the museum guide / a tired bus
    driver / the whole family / Bob / Emma / Philip / Maria / the village mayor / an honest
    butcher / the piano player / somebody upstairs / the new chef / a clever thief / the weather
    man / the judge / our science teacher / the bravest fireman in town
    """
)
DID = _items(
    """
    bought / found / moved / painted / forgot about / brought back / picked up / broke / loved /
    put away / measured / borrowed / dropped / photographed / saved / gave up / looked after /
    talked about / washed / hid / described / carried / built / drew / wrapped up / complained
    about / improved / watched / voted for / laughed about
    """
)
WHAT = _items(
    """
    a big brown box / the map of the valley / five paper boats / my mother's favorite poem / a
    bowl of fresh vegetables / the broken umbrella / an apple pie / the heavy piano / a pair of
    purple boots / the whole movie / two bottles of milk / the beautiful garden / a small wooden
    puppet / the front page of the paper / a very expensive lamp / the most amazing fish / a bunch
    of wild flowers / the oil lamp / a loud trumpet / the phone number / a fluffy white pillow /
    seven silver spoons / the voice of the river / a cup of coffee / the old farm house / a bag of
    brown rice / the football match / three feather beds / a huge blue vase / the empty mailbox
    """
)
WHERE = _items(
    """
    by the river / before breakfast / at the market / in front of the house / behind the barn /
    above the kitchen / after the storm / near the bus stop / on the first of May / for the fifth
    time / in the middle of the night / over the weekend / beside the path / without a map / from
    the top of the hill / under the bridge / during the summer / at half past five / on the way
    home / in the back of the van
    """
)
ASK = _items(
    """
    do you know why / who told you that / have you ever wondered whether / is it true that / can
    you believe that / did anybody notice that / would you mind if / what happens if / how could
    we prove that / are you absolutely sure that
    """
)
FEEL = _items(
    """
    wow / oh boy / how wonderful / no way / help / watch out / oh my / hooray / goodbye / what a
    beautiful morning / bravo / stop / never mind / come on / well done
    """
)
ADVICE = _items(
    """
    put the soup back on the stove / please keep both of your hands on the wheel / open your mouth
    and say ah / move over a bit / give me the phone / mind the gap / buy more butter before the
    shop closes / take off your wet boots / be brave and jump / show me how you fold the paper /
    leave my favorite mug alone / point at the highest roof / push the button and wait for the
    beep / pour the boiling water into the pot / bring an extra blanket for the baby / follow the
    yellow line / have a slice of pie / wave to the people on the boat / hum the melody again /
    choose a color that you enjoy
    """
)
STATE = _items(
    """
    the moon above the bay is almost full / maybe the problem is bigger than we thought / my phone
    fell into a bucket of paint / nobody believed a single word of it / most of the shops were
    empty by noon / the boy with the loud voice is my nephew / thin clouds moved over the northern
    mountains / the oyster tastes of salt and smoke / we measured the width of both paths / she
    sells fish and fruit from her father's van / a cold wind blew through the open window / their
    house is the one with the round tower / fifty people fit into that old bus / I hope you have a
    pleasant journey / the judge chose a large orange chair / he whispered the answer into my ear
    / the toy makes an annoying noise / good food should look good, too / our team played above
    its usual level / the road turns south beyond the farm / five thousand voices filled the
    valley / you could hear the bees all afternoon / an owl flew out of the ruined chapel / the
    cheap watch stopped at three / I would rather walk than wait for the ferry / bad weather makes
    everybody moody / that azure vase was a pleasure to behold / the thief threw three things off
    the bridge / our hound ran around the cow house / purple plums and peppers pile up on the
    plate / my mom makes marmalade on Mondays / big blue bubbles bob about in the bath / fine
    feathers fall from the five finches / very vivid violets cover the valley / the wise woman
    always wore white wool / sheep should sleep in a shed / joy and noise go together / it is
    usually a matter of measure and vision / the ground outside the house was brown / you use a
    few new tools at school
    """
)
NUMBERS = _items(
    """
    one / two / three / four / five / six / seven / eight / nine / ten / eleven / twelve / fifteen
    / twenty / forty / ninety / one hundred
    """
)
THINGS = _items(
    """
    maps / boats / apples / voices / bees / films / mirrors / puppies / waves / photographs /
    umbrellas / farms / poems / houses / jokes / thumbs
    """
)
SHARE_OF_WORD_LISTS = 0.22
WORDS_IN_A_LIST = (3, 6)


def sentence(rng: Generator, vocabulary: Sequence[str]) -> str:
    """One sentence: usually a template, sometimes words of `vocabulary` one after the other."""
    if vocabulary and rng.random() < SHARE_OF_WORD_LISTS:
        return _word_list(rng, vocabulary)
    return _finished(_TEMPLATES[rng.integers(len(_TEMPLATES))](rng))


def _pick(rng: Generator, choices: Sequence[str]) -> str:
    return choices[int(rng.integers(len(choices)))]


def _event(rng: Generator) -> str:
    place = f" {_pick(rng, WHERE)}" if rng.random() < 0.7 else ""
    return f"{_pick(rng, WHO)} {_pick(rng, DID)} {_pick(rng, WHAT)}{place}"


def _question(rng: Generator) -> str:
    return f"{_pick(rng, ASK)} {_event(rng)}?"


def _exclamation(rng: Generator) -> str:
    rest = _pick(rng, ADVICE) if rng.random() < 0.5 else _event(rng)
    return f"{_pick(rng, FEEL)}! {rest}!"


def _count(rng: Generator) -> str:
    first, second = _pick(rng, NUMBERS), _pick(rng, NUMBERS)
    return f"{first} {_pick(rng, THINGS)} and {second} {_pick(rng, THINGS)} {_pick(rng, WHERE)}"


def _because(rng: Generator) -> str:
    return f"{_event(rng)}, because {_pick(rng, STATE)}"


_TEMPLATES: tuple[Callable[[Generator], str], ...] = (
    _event,
    _event,
    _question,
    _exclamation,
    _count,
    _because,
    lambda rng: _pick(rng, STATE),
    lambda rng: _pick(rng, STATE),
    lambda rng: _pick(rng, ADVICE) + ("!" if rng.random() < 0.3 else ""),
)


def _word_list(rng: Generator, vocabulary: Sequence[str]) -> str:
    n_words = int(rng.integers(*WORDS_IN_A_LIST, endpoint=True))
    joint = ", " if rng.random() < 0.4 else " "
    return _finished(joint.join(_pick(rng, vocabulary) for _ in range(n_words)))


def _finished(words: str) -> str:
    ended = words if words[-1] in ".?!" else words + "."
    return re.sub(r"(^|[.?!] )([a-z])", lambda found: found[1] + found[2].upper(), ended)
