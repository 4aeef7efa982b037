// The client of `fret-monitor lsp` for VS Code.

const {workspace} = require('vscode');
const {LanguageClient} = require('vscode-languageclient/node');

let client;

exports.activate = async () => {
  const [command, ...args] = workspace.getConfiguration('fretMonitor').get('command');
  client = new LanguageClient('fretMonitor', 'fret_monitor', {command, args}, {
    documentSelector: [{language: 'yaml'}],
  });
  await client.start();
};

exports.deactivate = () => client?.stop();
