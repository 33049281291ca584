#!/usr/bin/env python3
"""usage: message_fields.py OUTPUT TYPE.lcm...

Writes the C++ header abs_hil/message_fields.hpp. It gives the fields of each message type by name, which lcm-gen's C++
does not offer. Each .lcm file must hold one type, whose fields are scalars, strings, or arrays of double. The length of an array
is the field just before it, an int32_t.
"""
import pathlib
import re
import sys

STRUCT = re.compile(r'\bstruct\s+(\w+)\s*\{(.*)\}', re.DOTALL)
CONSTANTS = re.compile(r'const\s.*', re.DOTALL)
FIELD = re.compile(r'(?:int8_t|int16_t|int32_t|int64_t|byte|boolean|float|double|string)\s+(\w+)')
ARRAY = re.compile(r'double\s+(\w+)\[(\w+)\]')

HEAD = '''#pragma once
// Made by lcmtypes/message_fields.py from lcmtypes/*.lcm. Do not edit.

#include <concepts>
#include <string_view>
#include <tuple>
#include <type_traits>

{includes}

namespace abs_hil::telemetry {{

/// A message type or its const form.
template <class M, class Message>
concept Is = std::same_as<std::remove_const_t<M>, Message>;

/// One field of a message type: its name and its member.
template <class Message, class Value>
struct Field {{
  std::string_view name;
  Value Message::* member;
}};
template <class Message, class Value>
Field(std::string_view, Value Message::*) -> Field<Message, Value>;

/// Name of a message type without its package, as in "telemetry_t".
template <class Message>
inline constexpr std::string_view type_name{{}};

/// std::tuple of the Fields of a message type, in the order in which they are encoded.
template <class Message>
inline constexpr std::tuple<> fields{{}};
'''
TYPE = '''
template <>
inline constexpr std::string_view type_name<{type}> = "{type}";
template <>
inline constexpr auto fields<{type}> = std::tuple{{
{fields}}};
'''
TAIL = '''
/// Calls `visit(name, value)` for every field of `message`, in the order in which they are encoded.
template <class M, class Visit>
void visit_fields(M& message, Visit&& visit) {{
  std::apply([&](const auto&... field) {{ (visit(field.name, message.*field.member), ...); }},
             fields<std::remove_const_t<M>>);
}}

/// Calls `use.template operator()<Message>()` for every message type.
template <class Use>
void for_each_message_type(Use&& use) {{
{uses}
}}

}}  // namespace abs_hil::telemetry
'''


def fields_of(path):
    """Names of the fields of the type in a .lcm file, in order."""
    text = re.sub(r'//[^\n]*|/\*.*?\*/', '', path.read_text(encoding='utf-8'), flags=re.DOTALL)
    struct = STRUCT.search(text)
    if struct is None or struct[1] != path.stem:
        raise ValueError(f'{path}: there is no "struct {path.stem}"; give one')
    names = []
    for statement in filter(None, map(str.strip, struct[2].split(';'))):
        if CONSTANTS.fullmatch(statement):
            continue
        field = FIELD.fullmatch(statement) or ARRAY.fullmatch(statement)
        if field is None or (field.re is ARRAY and names[-1:] != [field[2]]):
            raise ValueError(f'{path}: "{statement}" is neither a constant, nor a field of a scalar type or string, nor an '
                             'array of double that follows its length')
        names.append(field[1])
    return names


def header(paths):
    types = {path.stem: fields_of(path) for path in paths}
    text = HEAD.format(includes='\n'.join(f'#include "abs_hil/{type_}.hpp"' for type_ in types))
    for type_, names in types.items():
        rows = ',\n'.join(f'    Field{{"{name}", &{type_}::{name}}}' for name in names)
        text += TYPE.format(type=type_, fields=rows)
    return text + TAIL.format(uses='\n'.join(f'  use.template operator()<{type_}>();' for type_ in types))


def main():
    output, *paths = map(pathlib.Path, sys.argv[1:])
    try:
        output.write_text(header(paths), encoding='utf-8')
    except ValueError as problem:
        sys.exit(f'message_fields.py: {problem}')


if __name__ == '__main__':
    main()
