// A report as a page: `rows.js` draws what is in it.

const DATA = JSON.parse(document.getElementById('data').textContent);

document.querySelectorAll('button.copy').forEach((button) => {
  button.onclick = () => {
    const code = button.previousElementSibling;
    window.getSelection().selectAllChildren(code);
    if (navigator.clipboard) {
      navigator.clipboard.writeText(code.textContent).then(() => {
        button.textContent = 'copied';
      }, () => {});
    }
  };
});

document.querySelectorAll('details').forEach((node) => {
  node.ontoggle = () => drawReport(node, DATA);
});

let drawn = 0;
window.addEventListener('resize', () => {
  if (document.body.clientWidth !== drawn) {
    drawn = document.body.clientWidth;
    drawReport(document, DATA);
  }
});
drawn = document.body.clientWidth;
drawReport(document, DATA);
