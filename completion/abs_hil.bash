# Completion of abs_hil in bash: options and subcommands from the program's own --help, names from `abs_hil list`.
_abs_hil_names() { # KIND: the names that `abs_hil list` shows under this heading
  "${COMP_WORDS[0]}" list 2>/dev/null | awk -v kind="$1" '/^[a-z]/ { wanted = ($1 == kind); next } wanted { print $1 }'
}

_abs_hil_options() { # [SUBCOMMAND...]: the options in its help; what stands behind two spaces is the option's meaning
  "${COMP_WORDS[0]}" "$@" --help 2>/dev/null | sed -n 's/^ \{1,4\}-/-/p' | sed 's/   *.*//' |
    grep -oE -- '(^|[, ])--?[a-zA-Z][a-zA-Z-]*' | tr -d ', ' | sort -u
}

_abs_hil_subcommands() { # [SUBCOMMAND]: the subcommands in its help
  "${COMP_WORDS[0]}" "$@" --help 2>/dev/null | awk '/^[A-Z]/ { wanted = /^Subcommands/; next } wanted && /^  [a-z]/ { print $1 }'
}

_abs_hil() {
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} words="" before="" word
  local -a subcommand=()
  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
    # `study` and `send` have words of their own, the others none.
    if [[ ${#subcommand[@]} -eq 0 && " $(_abs_hil_subcommands | tr '\n' ' ')" == *" $word "* ]] ||
      [[ ${subcommand[*]} == study && " merge status submit " == *" $word "* ]]; then
      subcommand+=("$word")
    fi
  done
  case $previous in
    --backend) words="sim rig" ;;
    --rt) words="require prefer off" ;;
    --controller | --controllers)
      words=$(_abs_hil_names controllers)
      [[ $current != *,* ]] || before=${current%,*},  # of a list the last name
      ;;
    --plant | --model) words=$(_abs_hil_names plants) ;;
    --experiment) words=$(_abs_hil_names experiments) ;;
    --set) words=$("${COMP_WORDS[0]}" list --keys 2>/dev/null | awk '{ print $1 "=" }') ;;
    --csv | --log | --summary | --config | --histogram | --out) ;;
    *)
      if [[ $current == -* ]]; then
        words=$(_abs_hil_options "${subcommand[@]}")
      else
        case ${subcommand[*]} in
          "" | study) words=$(_abs_hil_subcommands "${subcommand[@]}") ;;
          validate) words=$(_abs_hil_names experiments) ;;
          send) words="stop start continue slip-ref gain" ;;
        esac
      fi
      ;;
  esac
  mapfile -t COMPREPLY < <(compgen -P "$before" -W "$words" -- "${current#"$before"}")
  if [ ${#COMPREPLY[@]} -eq 0 ]; then
    mapfile -t COMPREPLY < <(compgen -f -- "$current")
    compopt -o filenames 2>/dev/null  # for files alone: a folder called paper is not the experiment
  fi
  [[ $previous != --set ]] || compopt -o nospace 2>/dev/null
}
complete -F _abs_hil abs_hil
