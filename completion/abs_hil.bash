# Completion of abs_hil in bash: options and subcommands from the program's own --help, names from `abs_hil list`.
_abs_hil_names() { # KIND: the names that `abs_hil list` shows under this heading
  "${COMP_WORDS[0]}" list 2>/dev/null | awk -v kind="$1" '/^[a-z]/ { wanted = ($1 == kind); next } wanted { print $1 }'
}

_abs_hil() {
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} program=${COMP_WORDS[0]} words=""
  local subcommand="" word
  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
    case $word in -*) ;; *) [ -z "$subcommand" ] && [[ $previous != --* ]] && subcommand=$word ;; esac
  done
  if [ "$subcommand" = study ]; then
    for word in merge status submit; do
      [[ " ${COMP_WORDS[*]:2:COMP_CWORD-2} " == *" $word "* ]] && subcommand="study $word"
    done
  fi
  case $previous in
    --backend) words="sim rig" ;;
    --rt) words="require prefer off" ;;
    --controller | --controllers) words=$(_abs_hil_names controllers) ;;
    --plant | --model) words=$(_abs_hil_names plants) ;;
    --experiment) words=$(_abs_hil_names experiments) ;;
    --set) words=$("$program" list --keys 2>/dev/null | awk '{ print $1 "=" }') ;;
    --csv | --log | --summary | --config | --histogram | --out) ;;
    *)
      # shellcheck disable=SC2086  # no word at all where there is no subcommand
      words=$("$program" $subcommand --help 2>/dev/null | grep -oE '^ +(--?[a-zA-Z][a-z-]*|[a-z]+)' | tr -d ' ')
      # shellcheck disable=SC2086
      words+=" $("$program" $subcommand --help 2>/dev/null | grep -oE -- '--[a-z-]+' | tr '\n' ' ')"
      [ "$subcommand" = validate ] && words+=" $(_abs_hil_names experiments)"
      ;;
  esac
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
  [ ${#COMPREPLY[@]} -gt 0 ] || mapfile -t COMPREPLY < <(compgen -f -- "$current")
  [[ $previous == --set ]] && compopt -o nospace
}
complete -F _abs_hil abs_hil
