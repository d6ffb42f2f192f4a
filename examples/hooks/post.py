"""Posts the event to ntfy, Telegram or Slack. The secret is read from a file, not from the command.

on_fault = ["python3", "post.py", "ntfy", "https://ntfy.sh/a-topic-that-nobody-guesses"]
on_fault = ["python3", "post.py", "telegram", "/etc/smad/telegram.txt", "CHAT"]
on_fault = ["python3", "post.py", "slack", "/etc/smad/slack.txt"]

telegram.txt holds https://api.telegram.org/botTOKEN/sendMessage, slack.txt the address of the
incoming webhook.
"""

import json
import sys
import urllib.request
from pathlib import Path

event = json.load(sys.stdin)
service, target, *more = sys.argv[1:]
text = f"{event['bench']}: {event['text']}"
headers = {"Content-Type": "application/json"}
if service == "ntfy":
    address, body = target, text.encode()
    headers = {"Title": f"smad {event['event']}", "Priority": "high"}
elif service == "telegram":
    address = Path(target).read_text().strip()
    body = json.dumps({"chat_id": more[0], "text": text}).encode()
elif service == "slack":
    address = Path(target).read_text().strip()
    body = json.dumps({"text": text}).encode()
else:
    sys.exit(f"unknown service {service}: ntfy, telegram or slack")
request = urllib.request.Request(address, data=body, headers=headers, method="POST")
urllib.request.urlopen(request, timeout=10).read()
