"""Sends the event by sendmail: on_fault = ["python3", "mail.py", "you@example.org"]."""

import json
import os
import subprocess
import sys
from email.message import EmailMessage

event = json.load(sys.stdin)
message = EmailMessage()
message["To"] = sys.argv[1]
message["Subject"] = f"smad {event['bench']}: {event['text']}"[:200].replace("\n", " ")
message.set_content(json.dumps(event, indent=2))
sendmail = os.environ.get("SENDMAIL", "/usr/sbin/sendmail")
subprocess.run([sendmail, "-i", sys.argv[1]], input=message.as_bytes(), check=True)
