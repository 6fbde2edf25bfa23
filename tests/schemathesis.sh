#!/bin/sh
# Sends generated requests to a server of its own and checks each answer against the OpenAPI document that the
# server sends. Needs python3; installs schemathesis into target/schemathesis. Arguments: the program
# (default: target/release/sidestep with its site), and the number of examples an operation (default: 50). On
# PostgreSQL, run it within a cluster of its own: target/release/examples/with_postgres tests/schemathesis.sh
set -eu
cd "$(dirname "$0")/.."
program=${1:-target/release/sidestep}
examples=${2:-50}
version=4.32.5
seed=20180918
folder=$(mktemp -d)
database=sqlite:$folder/test.db
[ -z "${SIDESTEP_TEST_POSTGRES:-}" ] || database=$(printf %s "$SIDESTEP_TEST_POSTGRES" | sed 's/DATABASE/postgres/')
venv=$PWD/target/schemathesis
[ -x "$venv/bin/schemathesis" ] || { python3 -m venv "$venv"; "$venv/bin/pip" install -q "schemathesis==$version"; }

cat > "$folder/study.toml" <<'END'
slug = "default"
phases = [
  { phase = "familiarisation", scenes = 1, show_danger_zone = true },
  { phase = "practice", scenes = 1 },
  { phase = "task", scenes = 3 },
]
END
key=$(python3 -c 'import secrets; print(secrets.token_urlsafe(32))')
SIDESTEP_ADMIN_KEY=$key RUST_LOG=warn "$program" serve --listen 127.0.0.1:0 \
  --database "$database" --study "$folder/study.toml" ${SIDESTEP_SITE:+--static "$SIDESTEP_SITE"} \
  > "$folder/out" 2> "$folder/log" &
server=$!
trap 'kill $server 2>/dev/null || true; rm -rf "$folder"' EXIT
until grep -q laboratory "$folder/out"; do sleep 0.2; done
url=$(sed -n 's|.*laboratory *\(http.*\)/lab.*|\1|p' "$folder/out")
"$program" simulate --participants 3 --seed 1 --url "$url" > /dev/null

post() { curl -sf -X POST -H "Content-Type: application/json" "$@"; }
field() { python3 -c "import json, sys; print(eval('json.load(sys.stdin)' + sys.argv[1]))" "$1"; }
cookie=$(post -D - -o /dev/null -d "{\"key\":\"$key\"}" "$url/api/v1/admin/session" | sed -n 's/.*sidestep_session=\([^;]*\).*/\1/p')
admin() { curl -sf -H "Authorization: Bearer $key" "$url/api/v1/admin/$1"; }
trial=$(admin studies/default/trials | field "['trials'][0]['trial_id']")
person=$(admin studies/default/participants | field "['participants'][0]['participant_id']")
analysis=$(post -H "Authorization: Bearer $key" -d '{}' "$url/api/v1/admin/studies/default/analyses" | field "['id']")

# Names of things that are there, in the place of random ones.
known() {
  cat <<END
[parameters]
"path.slug" = "default"
END
  for operation in \
    "trials/{trial_id}|trial_id|$trial" "trials/{trial_id}/predictor|trial_id|$trial" \
    "participants/{id}|id|$person" "participants/{id}/notes|id|$person" \
    "participants/{id}/exclusion|id|$person" \
    "analyses/{id}|id|$analysis" "analyses/{id}/cancel|id|$analysis" \
    "analyses/{id}/predictors|id|$analysis"
  do
    path=${operation%%|*}; rest=${operation#*|}
    printf '[[operations]]\ninclude-path = "/api/v1/admin/%s"\nparameters = { "path.%s" = "%s" }\n' \
      "$path" "${rest%%|*}" "${rest#*|}"
  done
}

# A participant's token is new for each pass, since a pass may complete or withdraw the participation. A session
# stands for the key, because wrong keys are throttled; for the same reason the API tests, not this, try each
# route without a key. 422: it says what a JSON schema cannot, such as that times rise, or that the text of a
# study file is one. Three answers are allowed only where they have a meaning: 410 to participants (the
# participation has ended) and when somebody enrols (the study is over), 429 to whoever signs in (wrong keys), and
# 304 for what a browser has already.
expected() {
  printf 'expected-statuses = [%s]\n' "$1"
}
ended() {
  for path in "/api/v1/participants/.*" "/api/v1/studies/{slug}/participants" "/api/v1/studies/.*"; do
    accepts "$path" '"2xx", 304, 401, 403, 404, 409, 410, 422' '400, 401, 403, 404, 405, 410, 415, 422'
  done
  accepts "/api/v1/admin/session" '"2xx", 401, 403, 422, 429' '400, 401, 403, 404, 405, 415, 422, 429'
  accepts "/api/v1/(value-functions|admin/studies/{slug}/export).*" \
    '"2xx", 304, 401, 403, 404, 409, 412, 416, 422, 503' '400, 401, 403, 404, 405, 412, 415, 416, 422'
}
accepts() {
  printf '[[operations]]\ninclude-path-regex = "^%s$"\n' "$1"
  printf '[operations.checks.positive_data_acceptance]\n'; expected "$2"
  printf '[operations.checks.negative_data_rejection]\n'; expected "$3"
}
pass() {
  name=$1; token=$2; shift 2
  {
    cat <<END
[auth.openapi.session]
api_key = "$cookie"
[auth.openapi.participant]
bearer = "$token"
[checks.positive_data_acceptance]
expected-statuses = ["2xx", 401, 403, 404, 409, 422]
[checks.negative_data_rejection]
expected-statuses = [400, 401, 403, 404, 405, 415, 422]
END
    [ "$name" = random ] || known
    ended
  } > "$folder/$name.toml"
  echo "== $name names"
  # It keeps what it found beside it.
  (cd "$folder" && "$venv/bin/schemathesis" --config-file "$folder/$name.toml" run "$url/api/openapi.json" --url "$url" \
    --phases examples,coverage,fuzzing --checks all --exclude-checks ignored_auth --max-examples "$examples" --seed $seed \
    --continue-on-failure --request-timeout 20 --warnings off \
    --exclude-path /api/v1/admin/changes "$@")
}
enrol() {
  post -d '{"consent":true}' "$url/api/v1/studies/default/participants" | field "['token']"
}
failed=0
# Before the first pass, which may close the study.
first=$(enrol); second=$(enrol)
pass random "$first" || failed=1
pass known "$second" --exclude-method DELETE || failed=1
! grep -E "ERROR|panicked" "$folder/log" || failed=1
exit $failed
