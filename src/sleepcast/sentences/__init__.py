"""Commands as English sentences, both ways, for a part of the language.

    scouts within 5 mi of vessel X with more than 50 % fuel join bravo
    (WHEN (AND (< (DIST x y vessel_x vessel_y) 5mi) (> fuel 50%)) (JOIN bravo))

`lexicon` holds the words, those of the grammar and those of one fleet; `tokens` cuts a sentence into words and
numbers; `parser` makes an expression of a sentence (`cursor` and `conditions` are parts of it), and `writer` a
sentence of an expression. Nothing is guessed: a
sentence with a word that has no place in the grammar gives no expression, and the grammar gives each sentence one
meaning. The grammar is described in docs/howto/say-it-in-a-sentence.md.
"""

from sleepcast.sentences.cursor import Unclear
from sleepcast.sentences.lexicon import Lexicon
from sleepcast.sentences.parser import MAX_SENTENCE, ParsedSentence, SentenceError, from_sentence
from sleepcast.sentences.writer import Sentence, SentencePart, to_sentence

__all__ = [
    "MAX_SENTENCE",
    "Lexicon",
    "ParsedSentence",
    "Sentence",
    "SentenceError",
    "SentencePart",
    "Unclear",
    "from_sentence",
    "to_sentence",
]
