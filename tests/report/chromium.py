"""Drives headless Chromium over its debugging pipe, with Python's standard library alone."""
import json
import os
import subprocess
import time


class Chromium:
    """One page in a headless browser. `said` gathers what the page and the browser report as errors."""

    def __init__(self, folder, url, width=1000, height=1400):
        to_browser, self._out = os.pipe()
        self._in, from_browser = os.pipe()
        # The browser reads from descriptor 3 and writes to 4.
        command = f'exec chromium "$@" 3<&{to_browser} 4>&{from_browser}'
        self._process = subprocess.Popen(
            ['bash', '-c', command, 'bash', '--headless', '--no-sandbox', '--disable-gpu', '--hide-scrollbars',
             '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync',
             '--remote-debugging-pipe', f'--user-data-dir={folder}/profile', f'--window-size={width},{height}'],
            pass_fds=(to_browser, from_browser), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=folder)
        os.close(to_browser)
        os.close(from_browser)
        self._number = 0
        self._rest = b''
        self._session = None
        self.said = []
        target = self.call('Target.createTarget', url='about:blank')['targetId']
        self._session = self.call('Target.attachToTarget', targetId=target, flatten=True)['sessionId']
        for domain in ('Runtime', 'Log', 'Page'):
            self.call(f'{domain}.enable')
        self.call('Page.navigate', url=url)

    def close(self):
        self._process.kill()
        self._process.wait()
        os.close(self._out)
        os.close(self._in)

    def call(self, method, **parameters):
        self._number += 1
        message = {'id': self._number, 'method': method, 'params': parameters}
        if self._session is not None:
            message['sessionId'] = self._session
        os.write(self._out, json.dumps(message).encode() + b'\0')
        while True:
            answer = self._receive()
            if answer.get('id') == self._number:
                assert 'error' not in answer, answer
                return answer['result']
            self._note(answer)

    def _note(self, event):
        parameters = event.get('params', {})
        if event.get('method') == 'Runtime.exceptionThrown':
            self.said.append(parameters['exceptionDetails'])
        if event.get('method') == 'Log.entryAdded' and parameters['entry']['level'] in ('error', 'warning'):
            self.said.append(parameters['entry'])
        if event.get('method') == 'Runtime.consoleAPICalled' and parameters['type'] in ('error', 'warning', 'assert'):
            self.said.append(parameters['args'])

    def _receive(self):
        while b'\0' not in self._rest:
            data = os.read(self._in, 1 << 20)
            assert data, 'the browser has ended'
            self._rest += data
        message, _, self._rest = self._rest.partition(b'\0')
        return json.loads(message)

    def value(self, expression):
        """Value of a JavaScript expression in the page."""
        result = self.call('Runtime.evaluate', expression=expression, returnByValue=True, awaitPromise=True)
        assert 'exceptionDetails' not in result, result
        return result['result'].get('value')

    def wait_for(self, expression, what):
        """Waits until an expression is true, as long as the browser needs on a busy machine."""
        for _ in range(600):
            value = self.value(expression)
            if value:
                return value
            time.sleep(0.1)
        raise AssertionError(what)

    def mouse(self, kind, x, y, **more):
        self.call('Input.dispatchMouseEvent', type=kind, x=x, y=y, **more)

    def drag(self, x0, x1, y):
        held = {'button': 'left', 'clickCount': 1}
        self.mouse('mouseMoved', x0, y)
        self.mouse('mousePressed', x0, y, **held)
        for step in range(1, 11):
            self.mouse('mouseMoved', x0 + (x1 - x0) * step / 10, y, button='left', buttons=1)
        self.mouse('mouseReleased', x1, y, **held)
